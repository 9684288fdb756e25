//! The driver's reaction to each message and each tick; time is an argument.

use crate::armed::{Armed, Descent, make_safe};
use crate::settings::{Refusal, call_author_code, missing_settings, read_params, refusal, write_result};
use mapper_core::{Backend, BackendError, RigDescription, Setpoints};
use mapper_driver_host::protocol::{
    Code, Configure, DescribeResult, FRAME_LIMIT_BYTES, Hello, LEASE_S, LastSample, MAGIC, Message, Poll,
    VERSION, Welcome, split_batch, write_description, write_error,
};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

pub(crate) type OpenRig = Box<dyn FnOnce(&Value) -> Result<Box<dyn Backend>, BackendError>>;

/// Maximum run time of a simulated rig, s: beyond it the steps of a run-down would be lost to rounding.
const MAX_RUN_TIME_S: f64 = 1e9;

pub(crate) struct Server {
    name: &'static str,
    version: &'static str,
    session: String,
    open: Option<OpenRig>,
    rig: Option<(Box<dyn Backend>, RigDescription)>,
    armed: Option<Armed>,
    has_hello: bool,
    frame_limit_bytes: u32,
    /// The host has disconnected: end when the rig is safe.
    is_leaving: bool,
    pub(crate) out: Vec<Message>,
}

impl Server {
    pub(crate) fn new(name: &'static str, version: &'static str, session: String, open: OpenRig) -> Server {
        Server {
            name,
            version,
            session,
            open: Some(open),
            rig: None,
            armed: None,
            has_hello: false,
            frame_limit_bytes: mapper_driver_host::protocol::FIRST_FRAME_LIMIT_BYTES,
            is_leaving: false,
            out: Vec::new(),
        }
    }

    pub(crate) fn frame_limit_bytes(&self) -> u32 {
        self.frame_limit_bytes
    }

    pub(crate) fn is_over(&self) -> bool {
        self.is_leaving && self.armed.is_none()
    }

    /// Handles a message that arrived at this time of the driver's clock, s.
    pub(crate) fn handle_message(&mut self, now_s: f64, message: Message) {
        let known = message.session.as_deref() == Some(&self.session);
        self.start_clock(now_s);
        if let (Some(armed), true) = (&mut self.armed, known) {
            armed.lease_s = now_s + LEASE_S;
        }
        let (Some(id), Some(method)) = (message.id, message.method) else { return };
        let answer = match method.as_str() {
            "hello" => self.hello(&message.params),
            _ if !self.has_hello => Err(refusal(Code::OutOfOrder, "send `hello` first")),
            _ if !known => Err(refusal(Code::Refused, "the message belongs to another session")),
            "configure" => self.configure(&message.params),
            "describe" => self.describe(),
            "arm" => self.arm(now_s),
            "set" => self.set(&message.params),
            "hold" => self.hold(),
            "poll" => self.poll(&message.params),
            "make_safe" => self.make_safe(),
            "disarm" => self.disarm(),
            other => Err(refusal(Code::UnknownMethod, format!("unknown method `{other}`"))),
        };
        self.out.push(Message::answer(id, answer));
    }

    fn start_clock(&mut self, now_s: f64) {
        if let Some(armed) = self.armed.as_mut().filter(|armed| armed.is_new) {
            (armed.is_new, armed.at_s, armed.lease_s) = (false, now_s, now_s + LEASE_S);
        }
    }

    fn hello(&mut self, params: &Value) -> Result<Value, Refusal> {
        let host: Hello = read_params(params)?;
        if host.magic != MAGIC || host.protocol.major != VERSION.major {
            let (major, minor) = (VERSION.major, VERSION.minor);
            let message = format!("this driver uses version {major}.{minor} of the protocol {MAGIC}");
            return Err(refusal(Code::Refused, message));
        }
        self.has_hello = true;
        self.frame_limit_bytes =
            host.frame_limit_bytes.max(mapper_driver_host::protocol::FIRST_FRAME_LIMIT_BYTES);
        let hello = Hello {
            magic: MAGIC.to_owned(),
            protocol: VERSION,
            name: self.name.to_owned(),
            version: self.version.to_owned(),
            frame_limit_bytes: FRAME_LIMIT_BYTES,
        };
        write_result(&Welcome { hello, session: self.session.clone() })
    }

    fn configure(&mut self, params: &Value) -> Result<Value, Refusal> {
        let Configure { settings } = read_params(params)?;
        let Some(open) = self.open.take() else {
            return Err(refusal(Code::OutOfOrder, "the settings were already sent"));
        };
        let rig = call_author_code(|| open(&settings))?;
        let description = rig.describe();
        self.rig = Some((rig, description));
        Ok(json!({}))
    }

    fn describe(&self) -> Result<Value, Refusal> {
        let Some((_, rig)) = &self.rig else { return Err(missing_settings()) };
        let description = write_description(rig);
        let text =
            serde_json::to_vec(&description).map_err(|error| refusal(Code::Failed, error.to_string()))?;
        let identity = Sha256::digest(&text).iter().map(|byte| format!("{byte:02x}")).collect();
        write_result(&DescribeResult { description, identity })
    }

    fn arm(&mut self, now_s: f64) -> Result<Value, Refusal> {
        let Some((rig, _)) = &mut self.rig else { return Err(missing_settings()) };
        if self.armed.is_some() {
            return Err(refusal(Code::OutOfOrder, "the rig is armed"));
        }
        call_author_code(|| rig.arm())?;
        self.armed = Some(Armed::new(now_s));
        Ok(json!({}))
    }

    fn armed_rig(&mut self) -> Result<(&mut dyn Backend, &RigDescription, &mut Armed), Refusal> {
        let (Some((rig, description)), Some(armed)) = (&mut self.rig, &mut self.armed) else {
            return Err(refusal(Code::OutOfOrder, "the rig is not armed"));
        };
        Ok((rig.as_mut(), description, armed))
    }

    fn set(&mut self, params: &Value) -> Result<Value, Refusal> {
        let wanted: Setpoints = read_params(params)?;
        let (rig, description, armed) = self.armed_rig()?;
        if armed.has_ended || armed.descent.is_some() {
            return Err(lease_ended_refusal());
        }
        if let Some(accepts) = &description.accepts {
            accepts.check(&wanted).map_err(|error| Box::new(write_error(&error)))?;
        }
        call_author_code(|| rig.set(&wanted))?;
        armed.commanded = Some(wanted);
        Ok(json!({}))
    }

    fn hold(&mut self) -> Result<Value, Refusal> {
        let (rig, _, armed) = self.armed_rig()?;
        if armed.has_ended || armed.descent.is_some() {
            return Err(lease_ended_refusal());
        }
        if armed.commanded.is_none() {
            let message = "no setpoints to hold: none were set since arming or since it was made safe";
            return Err(refusal(Code::OutOfOrder, message));
        }
        call_author_code(|| rig.hold())?;
        Ok(json!({}))
    }

    fn poll(&mut self, params: &Value) -> Result<Value, Refusal> {
        let Poll { until_s } = read_params(params)?;
        if !until_s.is_finite() || until_s.abs() > MAX_RUN_TIME_S {
            return Err(refusal(Code::Params, format!("until_s is {until_s} s; at most {MAX_RUN_TIME_S} s")));
        }
        let limit = self.frame_limit_bytes;
        let (rig, description, armed) = self.armed_rig()?;
        if !description.simulated_time {
            return Err(refusal(
                Code::UnknownMethod,
                "this rig runs in real time and sends its samples unrequested",
            ));
        }
        let batch = call_author_code(|| rig.poll(until_s))?;
        armed.polled_s = armed.polled_s.max(until_s);
        let next_sequence = batch.first_sequence + batch.t_s.len() as u64;
        for piece in split_batch(&batch, limit) {
            self.out.push(Message::note("samples", write_result(&piece)?));
        }
        write_result(&LastSample { next_sequence })
    }

    fn make_safe(&mut self) -> Result<Value, Refusal> {
        let (rig, _, armed) = self.armed_rig()?;
        call_author_code(|| rig.make_safe())?;
        (armed.descent, armed.commanded, armed.is_unconfirmed) = (None, None, false);
        Ok(json!({}))
    }

    fn disarm(&mut self) -> Result<Value, Refusal> {
        let (.., armed) = self.armed_rig()?;
        if armed.commanded.is_some() || armed.descent.is_some() {
            self.make_safe()?;
        }
        let (rig, ..) = self.armed_rig()?;
        call_author_code(|| rig.disarm())?;
        self.armed = None;
        Ok(json!({}))
    }

    /// The host has disconnected: makes the rig safe, then ends.
    pub(crate) fn leave(&mut self, now_s: f64) {
        self.start_clock(now_s);
        if !self.is_leaving {
            self.is_leaving = true;
            self.begin_descent(now_s);
        }
    }

    fn begin_descent(&mut self, now_s: f64) {
        let Ok((_, description, armed)) = self.armed_rig() else { return };
        if armed.descent.is_none() && !armed.has_ended {
            let t_s = if description.simulated_time { armed.polled_s } else { now_s - armed.at_s };
            armed.descent = Some(Descent::new(armed.commanded, t_s));
            armed.has_ended = true;
        }
    }

    /// Runs the tasks that are due at this time of the driver's clock, s. Returns the time to the next task, s; `None`: no task.
    pub(crate) fn tick(&mut self, now_s: f64) -> Option<f64> {
        self.start_clock(now_s);
        let Some(armed) = &self.armed else { return None };
        if now_s >= armed.lease_s && !armed.has_ended {
            let message = "no message arrived during the lease; the rig executes its safe trajectory";
            self.out.push(Message::note("note", json!({ "message": message })));
            self.begin_descent(now_s);
        }
        let (limit, is_leaving) = (self.frame_limit_bytes, self.is_leaving);
        let Ok((rig, description, armed)) = self.armed_rig() else { return None };
        let simulated = description.simulated_time;
        let mut next_s = if armed.has_ended { 1.0 } else { armed.lease_s - now_s };
        let polls = !simulated && !armed.is_unconfirmed;
        if polls {
            let period_s = 1.0 / description.sample_rate_hz;
            let run_s = now_s - armed.at_s;
            // The newest due sample; half a millionth of a period is rounding.
            let due = (run_s / period_s + 5e-7).floor().max(0.0) as u64;
            if due >= armed.ticks {
                armed.ticks = due + 1;
                // A rig may measure nothing before its first setpoints.
                let waits = armed.commanded.is_none() && !armed.has_ended;
                match call_author_code(|| rig.poll(due as f64 * period_s)) {
                    Ok(batch) => {
                        let samples = split_batch(&batch, limit);
                        let notes = samples.iter().filter_map(|piece| write_result(piece).ok());
                        self.out.extend(notes.map(|samples| Message::note("samples", samples)));
                    }
                    Err(failure) if waits && failure.code == Code::OutOfOrder => {}
                    Err(failure) => {
                        let params = write_result(failure.as_ref()).unwrap_or_default();
                        self.out.push(Message::note("lost", params));
                    }
                }
            }
        }
        let Ok((rig, description, armed)) = self.armed_rig() else { return None };
        if polls {
            next_s = next_s.min(armed.ticks as f64 / description.sample_rate_hz - (now_s - armed.at_s));
        }
        if let Some((due_s, doubt)) = armed.continue_descent(rig, description, now_s, is_leaving) {
            next_s = next_s.min(due_s);
            if let Some(error) = doubt {
                let message =
                    format!("the rig did not confirm its safe state; the command is repeated: {error}");
                self.out.push(Message::note("note", json!({ "message": message })));
            }
        }
        if self.is_leaving {
            self.disarm_when_safe();
        }
        Some(next_s.max(0.0))
    }

    fn disarm_when_safe(&mut self) {
        let Ok((rig, _, armed)) = self.armed_rig() else { return };
        if armed.descent.is_none() {
            // The result does not matter: no host is left to report it to.
            let _ = make_safe(rig);
            let _ = call_author_code(|| rig.disarm());
            self.armed = None;
        }
    }
}

fn lease_ended_refusal() -> Refusal {
    refusal(Code::LeaseEnded, "the lease has ended and the rig was made safe; disarm it and arm it again")
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, ChannelColumn, RigMode, SafeTrajectory, SampleBatch};
    use mapper_driver_host::protocol::Failure;
    use proptest::prelude::*;
    use std::sync::{Arc, Mutex};

    type Log = Arc<Mutex<Vec<String>>>;

    /// Logs its commands.
    struct LoggingRig {
        log: Log,
        simulated_time: bool,
        samples: u64,
        /// Number of setpoints that it accepts before it panics.
        setpoints_accepted: usize,
        /// Number of times that it refuses to become safe.
        safe_states_refused: usize,
    }

    impl LoggingRig {
        fn write(&self, entry: String) -> Result<(), BackendError> {
            self.log.lock().unwrap().push(entry);
            Ok(())
        }
    }

    impl Backend for LoggingRig {
        fn describe(&self) -> RigDescription {
            RigDescription {
                backend: "logging".to_owned(),
                version: "1".to_owned(),
                channels: vec![Channel::T2],
                sample_rate_hz: 10.0,
                simulated_time: self.simulated_time,
                controls: true,
                exclusive: None,
                reached_at: None,
                needs_guarded: Vec::new(),
                accepts: None,
                safe: SafeTrajectory { p3_slew_pa_s: Some(100e3), valve_opening_ratio: 1.5, within_s: 5.0 },
            }
        }
        fn arm(&mut self) -> Result<(), BackendError> {
            Ok(())
        }
        fn set(&mut self, to: &Setpoints) -> Result<(), BackendError> {
            self.setpoints_accepted = self.setpoints_accepted.checked_sub(1).expect("as the test wants it");
            self.write(format!("{:.0} {:.0} {:.1}", to.p3_pa, to.t3_k, to.valve_opening_ratio))
        }
        fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
            self.samples += 1;
            if self.safe_states_refused > 0 {
                self.write("poll".to_owned())?;
            }
            let columns = vec![ChannelColumn { channel: Channel::T2, values: vec![300.0] }];
            let t_s = vec![until_s];
            Ok(SampleBatch { first_sequence: self.samples - 1, t_s, columns, ..SampleBatch::default() })
        }
        fn hold(&mut self) -> Result<(), BackendError> {
            self.write("hold".to_owned())
        }
        fn make_safe(&mut self) -> Result<(), BackendError> {
            if self.safe_states_refused == 0 {
                return self.write("safe".to_owned());
            }
            self.safe_states_refused -= 1;
            self.write("refused".to_owned())?;
            Err(BackendError::Lost { t_s: 0.0, source: "the controller restarts".into() })
        }
        fn disarm(&mut self) -> Result<(), BackendError> {
            Ok(())
        }
    }

    /// A driver that was armed at 0 s and set to 150 kPa, and the log of its rig since then.
    fn armed_server(simulated_time: bool, setpoints_accepted: usize) -> (Server, Log) {
        armed_server_that_refuses(simulated_time, setpoints_accepted, 0)
    }

    fn armed_server_that_refuses(
        simulated_time: bool,
        setpoints_accepted: usize,
        safe_states_refused: usize,
    ) -> (Server, Log) {
        let log = Log::default();
        let rig = LoggingRig {
            log: log.clone(),
            simulated_time,
            samples: 0,
            setpoints_accepted,
            safe_states_refused,
        };
        let open: OpenRig = Box::new(|_| Ok(Box::new(rig)));
        let mut server = Server::new("logging", "1", "s".to_owned(), open);
        let hello = json!({"magic": MAGIC, "protocol": VERSION, "name": "x", "version": "1", "frame_limit_bytes": 100_000});
        let setpoints = write_setpoints();
        for (method, params) in
            [("hello", hello), ("configure", json!({})), ("arm", json!({})), ("set", setpoints)]
        {
            ask(&mut server, 0.0, method, params);
        }
        log.lock().unwrap().clear();
        server.out.clear();
        (server, log)
    }

    fn write_setpoints() -> Value {
        let setpoints = Setpoints {
            mode: RigMode::Running,
            p3_pa: 150e3,
            t3_k: 773.15,
            valve_opening_ratio: 0.7,
            oil_temperature_k: 323.15,
        };
        serde_json::to_value(setpoints).unwrap()
    }

    fn ask(server: &mut Server, now_s: f64, method: &str, params: Value) -> Option<Failure> {
        let (id, session, method) = (Some(1), Some("s".to_owned()), Some(method.to_owned()));
        server.handle_message(now_s, Message { id, session, method, params, ..Message::default() });
        server.out.pop().and_then(|answer| answer.error)
    }

    /// From 150 kPa at 100 kPa/s, above the atmosphere's 105 kPa, with the heater off and the valve open; then the air.
    const RUN_DOWN: [&str; 5] =
        ["140000 293 1.5", "130000 293 1.5", "120000 293 1.5", "110000 293 1.5", "safe"];

    #[test]
    fn the_rig_becomes_safe_when_the_lease_ends_and_not_while_it_is_renewed() {
        let (mut server, log) = armed_server(false, 100);
        let lease = Message { session: Some("s".to_owned()), ..Message::note("lease", Value::Null) };
        for tenth in 0..100 {
            let now_s = f64::from(tenth) / 10.0;
            if tenth % 5 == 0 && tenth < 60 {
                server.handle_message(now_s, lease.clone());
            }
            server.tick(now_s);
            // The last renewal is at 5.5 s.
            assert!(log.lock().unwrap().is_empty() || now_s >= 7.5, "at {now_s} s");
        }
        assert_eq!(*log.lock().unwrap(), RUN_DOWN);
        let refused = ask(&mut server, 10.0, "set", write_setpoints()).unwrap();
        assert_eq!(refused.code, Code::LeaseEnded);
        assert!(ask(&mut server, 10.0, "disarm", json!({})).is_none());
        assert!(ask(&mut server, 10.0, "arm", json!({})).is_none());
        assert!(ask(&mut server, 10.0, "set", write_setpoints()).is_none());
    }

    /// Setpoints from before the safe state or the end of the lease must not be held: they would restore the air.
    #[test]
    fn hold_is_refused_after_the_safe_state() {
        let (mut server, log) = armed_server(false, 100);
        assert!(ask(&mut server, 0.1, "hold", json!({})).is_none());
        assert_eq!(*log.lock().unwrap(), ["hold"]);
        assert!(ask(&mut server, 0.2, "make_safe", json!({})).is_none());
        assert_eq!(ask(&mut server, 0.3, "hold", json!({})).unwrap().code, Code::OutOfOrder);
        assert!(ask(&mut server, 0.4, "set", write_setpoints()).is_none());
        server.tick(3.0);
        assert_eq!(ask(&mut server, 3.1, "hold", json!({})).unwrap().code, Code::LeaseEnded);
        assert_eq!(log.lock().unwrap().iter().filter(|call| *call == "hold").count(), 1);
    }

    /// Another session can neither renew the lease nor set anything.
    #[test]
    fn another_session_is_refused() {
        let (mut server, log) = armed_server(false, 100);
        let stranger =
            Message { id: Some(9), session: Some("t".to_owned()), ..Message::note("set", write_setpoints()) };
        server.handle_message(1.9, stranger);
        assert_eq!(server.out.pop().unwrap().error.unwrap().code, Code::Refused);
        server.tick(2.0);
        assert_eq!(log.lock().unwrap()[0], RUN_DOWN[0]);
    }

    #[test]
    fn a_driver_without_its_host_makes_the_rig_safe_and_ends() {
        for simulated_time in [false, true] {
            let (mut server, log) = armed_server(simulated_time, 100);
            server.leave(1.0);
            for tenth in 10..40 {
                server.tick(f64::from(tenth) / 10.0);
            }
            assert!(server.is_over());
            assert_eq!(log.lock().unwrap()[..RUN_DOWN.len()], RUN_DOWN, "{simulated_time}");
        }
    }

    /// If a rig panics at its second setpoint of the safe trajectory, its air is cut at once.
    #[test]
    fn a_failed_run_down_cuts_the_air_at_once() {
        let (mut server, log) = armed_server(false, 2);
        server.leave(1.0);
        server.tick(1.0);
        server.tick(1.1);
        assert_eq!(log.lock().unwrap()[..2], [RUN_DOWN[0], "safe"]);
        assert!(server.is_over());
    }

    /// The controller does not respond when the lease ends. The driver retries every 0.1 s, without polling, so that the heartbeat stops.
    /// It does not disarm the rig before the safe state is confirmed.
    #[test]
    fn an_unconfirmed_safe_state_is_repeated_and_the_heartbeat_stops() {
        let (mut server, log) = armed_server_that_refuses(false, 1, 30);
        let mut next_s = 2.0;
        for hundredth in 0..600 {
            let now_s = f64::from(hundredth) / 100.0;
            if now_s >= next_s {
                next_s = now_s + server.tick(now_s).unwrap().max(0.01);
            }
            if hundredth == 300 {
                assert!(ask(&mut server, now_s, "disarm", json!({})).is_some());
            }
        }
        let log = log.lock().unwrap();
        let first = log.iter().position(|call| call == "refused").unwrap();
        let (before, after) = log.split_at(first);
        assert!(before.iter().all(|call| call == "poll"), "{before:?}");
        assert_eq!(after.iter().filter(|call| *call == "refused").count(), 30);
        let polled = after.iter().take_while(|call| *call != "safe").filter(|call| *call == "poll").count();
        assert_eq!(polled, 0, "{after:?}");
        assert!(after.contains(&"safe".to_owned()));
    }

    /// Values that no host sends, in addition to those that it does.
    fn arbitrary_value() -> impl Strategy<Value = Value> {
        prop_oneof![
            Just(Value::Null),
            any::<f64>().prop_map(|number| json!(number)),
            Just(json!({"magic": MAGIC, "protocol": {"major": -1}})),
            Just(json!({"until_s": 1e308})),
            Just(json!({"settings": [{"x": []}]})),
            Just(write_setpoints()),
            prop::collection::vec(any::<bool>(), 0..4)
                .prop_map(|bits| json!({"p3_pa": bits, "until_s": "x"})),
        ]
    }

    proptest! {
        /// Any messages in any order: one answer to each request, no panic, and a rig without a host becomes safe.
        #[test]
        fn no_messages_keep_a_rig_from_becoming_safe(
            steps in prop::collection::vec((0usize..10, any::<bool>(), arbitrary_value(), 0.0f64..3.0), 0..60), simulated: bool,
        ) {
            const METHODS: [&str; 10] =
                ["hello", "configure", "describe", "arm", "set", "poll", "make_safe", "disarm", "__class__", "hold"];
            let (mut server, log) = armed_server_that_refuses(simulated, 1_000, 3);
            let mut now_s = 0.0;
            for (id, (method, known, params, later_s)) in steps.into_iter().enumerate() {
                now_s += later_s;
                server.tick(now_s);
                server.out.clear();
                let session = Some(if known { "s" } else { "another" }.to_owned());
                let (id, method) = (Some(id as u64), Some(METHODS[method].to_owned()));
                server.handle_message(now_s, Message { id, session, method, params, ..Message::default() });
                prop_assert_eq!(server.out.iter().filter(|message| message.id == id).count(), 1);
            }
            let held = server.armed.is_some();
            log.lock().unwrap().clear();
            server.leave(now_s);
            for tenth in 0..300 {
                server.tick(now_s + f64::from(tenth) / 10.0);
            }
            prop_assert!(server.is_over());
            prop_assert!(!held || log.lock().unwrap().contains(&"safe".to_owned()));
        }
    }
}
