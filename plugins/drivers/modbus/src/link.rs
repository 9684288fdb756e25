//! The connection to the controller. Every call has a deadline, and a failed call closes the connection: the answer
//! to a request that timed out may still arrive, and this library would take it for the answer to the next
//! (slowtec/tokio-modbus issue 324).

use crate::registers::Block;
use std::future::Future;
use std::io::ErrorKind;
use std::net::SocketAddr;
use std::time::{Duration, Instant};
use tokio::runtime::Runtime;
use tokio::time::timeout;
use tokio_modbus::ProtocolError;
use tokio_modbus::client::{Client, Context, tcp};
use tokio_modbus::prelude::{ExceptionCode, Request, Response, Slave};

#[derive(Debug, thiserror::Error)]
pub(crate) enum LinkError {
    #[error("{address} did not answer within {} ms (`timeout`, at most 800 ms; slower controllers are not supported)", within.as_millis())]
    Late { address: SocketAddr, within: Duration },
    #[error("{address}: {reason}")]
    Failed { address: SocketAddr, reason: String },
    #[error("{address} refuses {operation}: {reason}")]
    Refused { address: SocketAddr, operation: String, code: ExceptionCode, reason: String },
}

impl LinkError {
    /// Whether the controller asks for a retry (Modbus Application Protocol 1.1b3, sect. 7: acknowledge, server device busy).
    fn is_busy(&self) -> bool {
        matches!(
            self,
            LinkError::Refused { code: ExceptionCode::Acknowledge | ExceptionCode::ServerDeviceBusy, .. }
        )
    }
}

/// Delay before a busy controller is asked for a second time.
const RETRY_DELAY: Duration = Duration::from_millis(40);

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Table {
    /// Holding registers (read and write).
    Holding,
    Input,
}

pub(crate) struct Link {
    runtime: Runtime,
    address: SocketAddr,
    unit: u8,
    within: Duration,
    deadline: Option<Instant>,
    connection: Option<Context>,
}

impl Link {
    pub(crate) fn new(address: SocketAddr, unit: u8, within: Duration) -> std::io::Result<Link> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        Ok(Link { runtime, address, unit, within, deadline: None, connection: None })
    }

    pub(crate) fn close(&mut self) {
        self.connection = None;
    }

    /// Makes a group of writes with one deadline, retries and new connections included, since the caller of the
    /// group waits no longer.
    pub(crate) fn write_group<T>(&mut self, within: Duration, writes: impl FnOnce(&mut Link) -> T) -> T {
        self.deadline = Instant::now().checked_add(within);
        let done = writes(self);
        self.deadline = None;
        done
    }

    fn time_left(&self) -> Duration {
        let left = self.deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        left.map_or(self.within, |left| left.min(self.within))
    }

    /// Reads registers; retries once if the controller had closed a kept connection or is busy.
    pub(crate) fn read(&mut self, table: Table, block: Block) -> Result<Vec<u16>, LinkError> {
        let was_kept = self.connection.is_some();
        match self.read_once(table, block) {
            Err(LinkError::Failed { .. }) if was_kept => self.read_once(table, block),
            Err(busy) if busy.is_busy() => {
                self.pause();
                self.read_once(table, block)
            }
            answer => answer,
        }
    }

    fn read_once(&mut self, table: Table, block: Block) -> Result<Vec<u16>, LinkError> {
        let Block { start, count } = block;
        let request = || match table {
            Table::Holding => Request::ReadHoldingRegisters(start, count),
            Table::Input => Request::ReadInputRegisters(start, count),
        };
        let operation = format!("registers {start} to {}", start + (count - 1));
        // The reading functions of the library would panic on a wrong number of registers.
        let reason = match self.call(operation, async |link| link.call(request()).await)? {
            Response::ReadHoldingRegisters(registers) | Response::ReadInputRegisters(registers)
                if registers.len() == usize::from(count) =>
            {
                return Ok(registers);
            }
            Response::ReadHoldingRegisters(registers) | Response::ReadInputRegisters(registers) => {
                format!("{} registers received, {count} requested", registers.len())
            }
            other => format!("a read was answered with function {}", other.function_code()),
        };
        self.connection = None;
        Err(LinkError::Failed { address: self.address, reason })
    }

    /// Writes registers; retries once, if necessary on a new connection, since writing the same value twice does no harm. A busy
    /// controller is retried until the timeout of the request.
    pub(crate) fn write(&mut self, start: u16, registers: &[u16]) -> Result<(), LinkError> {
        let deadline = Instant::now() + self.time_left();
        let mut answer = self.write_once(start, registers);
        while answer.as_ref().is_err_and(LinkError::is_busy) && Instant::now() + RETRY_DELAY < deadline {
            self.pause();
            answer = self.write_once(start, registers);
        }
        match answer {
            Err(_) => self.write_once(start, registers),
            done => done,
        }
    }

    /// The acknowledgement must match the write: a gateway that mixes up its answers has written nothing, or somewhere else.
    fn write_once(&mut self, start: u16, registers: &[u16]) -> Result<(), LinkError> {
        let request = || Request::WriteMultipleRegisters(start, registers.into());
        let answer =
            self.call(format!("a value for register {start}"), async |link| link.call(request()).await)?;
        let reason = match answer {
            Response::WriteMultipleRegisters(address, count)
                if address == start && usize::from(count) == registers.len() =>
            {
                return Ok(());
            }
            Response::WriteMultipleRegisters(address, count) => format!(
                "{} registers from {start} on were written, and {count} from {address} on acknowledged",
                registers.len()
            ),
            other => format!("a write was answered with function {}", other.function_code()),
        };
        self.connection = None;
        Err(LinkError::Failed { address: self.address, reason })
    }

    fn pause(&self) {
        let pause = RETRY_DELAY.min(self.time_left());
        self.runtime.block_on(async { tokio::time::sleep(pause).await });
    }

    fn describe_exception(&self, code: ExceptionCode) -> String {
        let number = u8::from(code);
        match code {
            ExceptionCode::GatewayPathUnavailable | ExceptionCode::GatewayTargetDevice => {
                format!("exception {number}, {code}: it has no unit {}; check `unit`", self.unit)
            }
            code => format!("exception {number}, {code}"),
        }
    }

    fn call<T>(
        &mut self,
        operation: String,
        request: impl AsyncFnOnce(&mut Context) -> tokio_modbus::Result<T>,
    ) -> Result<T, LinkError> {
        let (address, within) = (self.address, self.time_left());
        let late = LinkError::Late { address, within };
        let mut connection = match self.connection.take() {
            Some(connection) => connection,
            None => {
                let connect = tcp::connect_slave(address, Slave(self.unit));
                let connected = self.runtime.block_on(in_time(within, connect)).ok_or(late)?;
                connected.map_err(|error| LinkError::Failed { address, reason: error.to_string() })?
            }
        };
        let within = self.time_left();
        let answer = self.runtime.block_on(in_time(within, request(&mut connection)));
        match answer {
            None => Err(LinkError::Late { address, within }),
            Some(Err(error)) => Err(LinkError::Failed { address, reason: describe_failure(&error) }),
            Some(Ok(answer)) => {
                self.connection = Some(connection);
                answer.map_err(|code| LinkError::Refused {
                    address,
                    operation,
                    code,
                    reason: self.describe_exception(code),
                })
            }
        }
    }
}

/// Describes a failure without the registers of a wrong answer, which differ each time.
fn describe_failure(error: &tokio_modbus::Error) -> String {
    match error {
        tokio_modbus::Error::Protocol(ProtocolError::HeaderMismatch { .. }) => {
            "an answer has another transaction or unit than its request".to_owned()
        }
        tokio_modbus::Error::Protocol(ProtocolError::FunctionCodeMismatch { request, .. }) => {
            format!("an answer to function {request} has another function code")
        }
        // The library reports a closed connection as the last error of the thread, whatever that was.
        tokio_modbus::Error::Transport(error)
            if error.raw_os_error().is_some() && error.kind() != ErrorKind::ConnectionReset =>
        {
            "the controller closed the connection".to_owned()
        }
        tokio_modbus::Error::Transport(error) => error.to_string(),
    }
}

/// `None` on timeout. The timer must be created inside the runtime.
async fn in_time<T>(within: Duration, work: impl Future<Output = T>) -> Option<T> {
    timeout(within, work).await.ok()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// A controller that accepts connections and stays silent, at the maximum timeout: the writes of the safe state
    /// end before their host stops waiting, at 2 s.
    #[test]
    fn a_group_of_writes_keeps_its_deadline() {
        let mute = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let mut link = Link::new(mute.local_addr().unwrap(), 255, Duration::from_millis(800)).unwrap();
        let began = Instant::now();
        let failed = link.write_group(Duration::from_millis(1500), |link| {
            (0..3).filter(|register| link.write(*register, &[0]).is_err()).count()
        });
        assert_eq!(failed, 3);
        let took_s = began.elapsed().as_secs_f64();
        // Six separate attempts would take 4.8 s; the rest is for a busy machine.
        assert!((1.4..4.0).contains(&took_s), "{took_s} s");
        // The next request has its full timeout.
        assert_eq!(link.time_left(), Duration::from_millis(800));
        // One that is always too slow: the message gives the range of the setting.
        let mut quick = Link::new(mute.local_addr().unwrap(), 255, Duration::from_millis(20)).unwrap();
        let message = quick.read(Table::Holding, Block { start: 0, count: 1 }).unwrap_err().to_string();
        assert!(message.contains("20 ms") && message.contains("800 ms"), "{message}");
    }
}
