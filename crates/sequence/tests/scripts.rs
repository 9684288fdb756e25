//! Scripts against a caller that answers without a rig: what they may and may not do, and what they receive.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{
    Channel, CommonErrors, Dwell, IdentifiedPoint, Limits, Method, OperatingPoint, RigActuators,
    SetpointRange, SetpointRanges, SettleBands, StepKind, Timing, Verdict, WindowRule,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_sequence::{
    EndCondition, Script, ScriptError, SequenceError, SequenceRequest, SequenceRunner, SequenceStep,
    StepResult,
};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

fn request() -> SequenceRequest {
    let points = [50e3, 110e3, 150e3].into_iter().flat_map(|speed_rpm| {
        [0.7, 1.0].map(|valve_opening_ratio| OperatingPoint { speed_rpm, valve_opening_ratio })
    });
    SequenceRequest {
        points: points.collect(),
        timing: Timing { warm_up_s: 60.0, dwell: Dwell::Fixed(120.0), cool_down_s: 0.0 },
        window: WindowRule::Fixed { start_s: 10.0, end_s: 110.0 },
        settle_bands: SettleBands::default(),
        model: Model::nominal(),
        boundary: BoundaryConditions::default(),
        follow_outlet: mapper_physics::operating_point::reach::FollowOutlet::default(),
        limits: Limits {
            speed_max_rpm: 180e3,
            p3_min_pa: 120e3,
            p3_max_pa: 500e3,
            p3_stroke_s: None,
            t2_max_k: Some(573.0),
            t3_max_k: None,
            surge_margin_min_ratio: None,
            housing_gradient_max_k: None,
            overshoot_max_ratio: None,
            avoid: mapper_core::AvoidedSpeeds::NONE,
        },
        accepts: Some(SetpointRanges {
            p3_pa: SetpointRange { low: 50e3, high: 2e6 },
            t3_k: SetpointRange { low: 250.0, high: 1400.0 },
            valve_opening_ratio: SetpointRange { low: 0.05, high: 2.5 },
            oil_temperature_k: SetpointRange { low: 250.0, high: 450.0 },
        }),
        actuators: RigActuators::default(),
        order: Box::new(|points| Ok(points.iter().rev().copied().collect())),
    }
}

fn start(text: &str) -> SequenceRunner {
    let script = Script { path: "test.rhai".into(), text: text.to_owned() };
    SequenceRunner::start(script, request()).unwrap()
}

/// What a step gives here: an efficiency that grows with each step.
fn answer(step: &SequenceStep) -> StepResult {
    let step = &step.step;
    let point = IdentifiedPoint {
        step: step.index,
        kind: step.kind,
        target: Some(step.to),
        speed_rpm: step.to.speed_rpm,
        valve_opening_ratio: step.to.valve_opening_ratio,
        flow_kg_s: 0.05,
        flow_corrected_kg_s: 0.05,
        speed_corrected_rpm: step.to.speed_rpm,
        pressure_ratio: 1.5,
        t1_k: 298.0,
        p1_pa: 100e3,
        eta: Some(0.5 + 0.01 * step.index as f64),
        eta_low: None,
        eta_high: None,
        eta_allowance: None,
        eta_uncertainty: None,
        h_w_m2k: None,
        h_low_w_m2k: None,
        h_high_w_m2k: None,
        h_uncertainty: None,
        common: CommonErrors::default(),
        method: Method::Dynamic,
        verdict: if step.index == 0 { Verdict::Unusable } else { Verdict::Good },
        warnings: Vec::new(),
        window: None,
        residual_rms_k: None,
        dt2_k: None,
        dtc_k: None,
    };
    StepResult {
        number: step.index + 1,
        target: step.to,
        from: step.from,
        start_s: step.start_s,
        end_s: step.start_s + step.dwell_s,
        identified: Some(point),
        readings: BTreeMap::from([(Channel::P2, (150e3, 400.0))]),
    }
}

/// After a rest no jump leads to the step, and the rest passes before it; a wait stays where the machine is.
#[test]
fn a_rest_has_no_jump_after_it_and_a_wait_has_none_at_all() {
    let script = "let p = grid()[0]; jump(p, \"60 s\"); rest(\"5 min\"); rest(\"5 min\"); jump(p, \"60 s\"); hold(\"30 s\");";
    let steps = steps_of(script);
    let [first, restarted, waited] = steps.as_slice() else { panic!("{steps:?}") };
    let rests_s = [first, restarted, waited].map(|step| step.rest.map_or(0.0, |rest| rest.duration_s));
    assert_eq!(rests_s, [0.0, 600.0, 0.0]);
    let end_s = first.step.start_s + first.step.dwell_s;
    assert!((restarted.step.start_s - end_s - 600.0).abs() < 1e-9);
    assert!(restarted.step.from.is_none() && restarted.step.transition.is_none());
    assert_eq!((waited.step.from, waited.step.to), (Some(first.step.to), first.step.to));
    assert!(play("rest(\"5 min\");").2.is_err() && play("hold(\"5 min\");").2.is_err());
}

#[test]
fn a_script_reads_mean_and_variance_of_a_channel() {
    let notes = play(
        "let r = jump(grid()[0]); note(`${r.mean(\"P2\")} ${r.variance(\"P2\")} ${r.mean(\"T4\") == ()}`);",
    )
    .1;
    assert_eq!(notes, ["150000.0 400.0 true"]);
    assert!(play("jump(grid()[0]).mean(\"P9\");").2.is_err());
}

type Played = (Vec<SequenceStep>, Vec<String>, Result<(), SequenceError>);

fn play(text: &str) -> Played {
    let mut runner = start(text);
    let (mut steps, mut finished): (Vec<SequenceStep>, _) = (Vec::new(), None);
    let end = loop {
        match runner.next_step(finished.take()) {
            Ok(Some(step)) => {
                finished = Some(answer(&step));
                steps.push(step);
            }
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    assert!(matches!(runner.next_step(None), Ok(None)), "an ended script stays ended");
    (steps, runner.take_notes(), end)
}

fn steps_of(text: &str) -> Vec<SequenceStep> {
    let (steps, _, end) = play(text);
    end.unwrap_or_else(|error| panic!("{error}"));
    steps
}

fn error_of(text: &str) -> ScriptError {
    match play(text).2 {
        Err(SequenceError::Script(error)) => *error,
        other => panic!("{text:.200}: {other:?}"),
    }
}

#[test]
fn a_script_yields_its_steps_in_order_and_sees_their_results() {
    let text = r#"
        dwell("90 s");
        let a = jump(point("50 krpm", 1));
        let b = jump(point("110 krpm", 0.7), "2 min");
        let again = repeat(b.step);
        settle(midpoint(a.point, b.point), "10 min");
        note(`${a.has_eta} ${a.sigma_eta > 0.005} ${b.eta} ${again.eta} ${results().len()} ${result(2).step}`);
    "#;
    let (steps, notes, end) = play(text);
    end.unwrap();
    // The repeat of step 2 goes back to where step 2 came from.
    let speeds: Vec<f64> = steps.iter().map(|step| step.step.to.speed_rpm).collect();
    assert_eq!(speeds, [50e3, 110e3, 50e3, 110e3, 80e3]);
    let dwells: Vec<f64> = steps.iter().map(|step| step.step.dwell_s).collect();
    assert_eq!(dwells, [90.0, 120.0, 90.0, 120.0, 600.0]);
    let starts: Vec<f64> = steps.iter().map(|step| step.step.start_s).collect();
    assert_eq!(starts, [60.0, 150.0, 270.0, 360.0, 480.0]);
    let kinds: Vec<StepKind> = steps.iter().map(|step| step.step.kind).collect();
    use StepKind::{Point, Repeat};
    assert_eq!(kinds, [Point, Point, Repeat, Repeat, Point]);
    assert_eq!(steps[1].step.from, Some(steps[0].step.to));
    assert!(matches!(steps[4].end, EndCondition::UntilSettled(_)) && steps[3].end == EndCondition::Dwell);
    assert_eq!(notes, ["false true 0.51 0.53 5 2"]);
}

/// The reference table of the model: P3 at 110 krpm and 150 krpm; and a jump up warms the housing.
#[test]
fn steps_carry_what_the_nominal_machine_expects() {
    let steps = steps_of(r#"jump(point("50 krpm", 0.5)); jump(point("150 krpm", 0.5));"#);
    assert_eq!(steps[0].step.predicted.dtc_k, None);
    assert!(steps[1].step.predicted.dtc_k.unwrap() > 20.0, "{:?}", steps[1].step.predicted);
    assert!((steps[1].step.p3_pa / 1e3 - 218.6).abs() < 0.1, "{}", steps[1].step.p3_pa);
}

#[test]
fn the_planner_orders_what_it_is_given() {
    let steps = steps_of("for p in order(grid()) { jump(p); }");
    let expected: Vec<OperatingPoint> = request().points.into_iter().rev().collect();
    assert_eq!(steps.iter().map(|step| step.step.to).collect::<Vec<_>>(), expected);
    let error = error_of("let x = 1;\norder([x]);");
    assert!(error.line == Some(2) && error.message.contains("points"), "{error}");
}

#[test]
fn no_step_leaves_the_limits() {
    for (step, word) in [
        (r#"jump(point("250 krpm", 1.0))"#, "above the speed limit, `limits.speed` = 180 krpm"),
        (r#"jump(point("110 krpm", 2.6))"#, "valve's range"),
        (r#"jump(point("110 krpm", 0.0))"#, "valve's range"),
        (r#"jump(point("110 krpm", 0.0/0.0))"#, "valve's range"),
        (r#"jump(point("-5 krpm", 1.0))"#, "shaft speed"),
        (r#"jump(point("10 krpm", 1.0))"#, "below `limits.turbine_inlet_pressure.min` = 120 kPa"),
        (r#"settle(point("250 krpm", 1.0), "60 s")"#, "above the speed limit, `limits.speed` = 180 krpm"),
        (r#"jump(point("110 krpm", 0.2))"#, "beyond the surge line"),
        (r#"jump(point("110 krpm", 1.0), "25 h")"#, "14400 s"),
        (r#"jump(point("110 krpm", 1.0), "-5 s")"#, "more than 0 s"),
        (r#"jump(point("110", 1.0))"#, "has no unit"),
        ("repeat(1)", "no result of step 1"),
    ] {
        let error = error_of(&format!("// first line\n  {step};\n"));
        assert_eq!(error.line, Some(2), "{error}");
        assert!(error.message.contains(word), "{error}");
        assert!(!error.remedy.is_empty(), "{error}");
    }
    // What is refused may be caught, and leads nowhere.
    let steps = steps_of(r#"try { jump(point("250 krpm", 1.0)); } catch { jump(grid()[0]); }"#);
    assert_eq!(steps.len(), 1);
    let steps =
        steps_of(r#"if !reachable(point("250 krpm", 1.0)) && reachable(grid()[0]) { jump(grid()[0]); }"#);
    assert_eq!(steps.len(), 1);
}

#[test]
fn an_error_shows_its_line_with_a_caret() {
    let shown = error_of("let p = grid()[0];\njump(p);\n    throw \"enough\";\n").to_string();
    let expected = "enough\n --> test.rhai:3:5\n  |\n3 |     throw \"enough\";\n  |     ^";
    assert_eq!(shown, expected);
    let called = error_of("fn far(n) {\n  jump(point(\"999 krpm\", n));\n}\n\nfar(1);\n");
    assert_eq!((called.line, called.called_from.as_slice()), (Some(2), &[5][..]), "{called}");
    let unreadable = error_of("let a = ;");
    assert!(unreadable.line == Some(1) && unreadable.message.contains("cannot be read"), "{unreadable}");
}

/// In a branch that is not taken, before the first step.
#[test]
fn names_that_nothing_has_are_found_without_running_them() {
    for (text, place, word, help) in [
        ("jump(grid()[0]);\nif false_one() { }\n", (2, 4), "no function `false_one`", ""),
        (
            "let r = jump(grid()[0]);\nif r.eta > 2.0 { jmup(grid()[1]); }",
            (2, 18),
            "no function `jmup`",
            "did you mean `jump`?",
        ),
        (
            "let r = jump(grid()[0]);\nif r.eta > 2.0 { note(r.sigma_etta); }",
            (2, 25),
            "property `sigma_etta`",
            "`sigma_eta`",
        ),
        ("fn late(p) { settle(p); }\njump(grid()[0]);", (1, 14), "`settle` is called with 1 arguments", ""),
        (
            "let a = [];\njump(grid()[0]);\nif a.len() > 3 { a.pusch(1); }",
            (3, 20),
            "no function `pusch`",
            "`push`",
        ),
    ] {
        let error = error_of(text);
        assert!(error.message.contains(word), "{error}");
        assert_eq!((error.line, error.column), (Some(place.0), Some(place.1)), "{error}");
        assert!(error.remedy.contains(help), "{error}");
    }
    // Maps have the properties that a script gives them, functions of the script's own are known, and so are anonymous ones.
    let steps = steps_of(
        "let m = #{at: 0};\nm.more = 1;\nfn of(m) { grid()[m.at] }\nlet f = |p| p.opening;\njump(of(m));\nnote(`${f.call(of(m))}`);",
    );
    assert_eq!(steps.len(), 1);
}

#[test]
fn hostile_scripts_end_with_an_error() {
    for (text, word) in [
        ("loop { }", "operations"),
        ("while true { let x = 1; }", "operations"),
        ("for i in 0..9_000_000_000_000 { let x = i; }", "operations"),
        ("loop { try { loop { } } catch { } }", "operations"),
        ("let a = [0]; a.map(|x| { loop { } });", "operations"),
        ("let a = [0]; a.for_each(|| { loop { } });", "operations"),
        // Sorting goes on without a comparison that fails.
        ("let a = [2, 1]; a.sort(|x, y| { loop { } }); let b = 1;", "operations"),
        ("let a = [0]; a.filter(|x| { while true { } });", "operations"),
        ("let a = [0]; a.reduce(|sum, x| { loop { } });", "operations"),
        (
            "let a = []; a.pad(4000, 0); a.map(|x| { let b = []; b.pad(4000, 0); b.map(|y| y + 1) });",
            "operations",
        ),
        ("let a = [0]; loop { try { a.map(|x| { loop { } }); } catch { } }", "operations"),
        ("fn f(n) { f(n + 1) }\nf(0);", "deep"),
        ("fn f(n) { try { f(n + 1) } catch { f(n + 1) } }\nf(0);", ""),
        ("let s = \"x\"; loop { s += s; }", "too large"),
        ("let a = []; loop { a.push(a); }", "too large"),
        ("let a = []; loop { a = [a]; }", "too large"),
        ("let a = [0]; loop { a += a; }", "too large"),
        ("let m = #{}; let i = 0; loop { m[i.to_string()] = i; i += 1; }", "too large"),
        (
            "let b = []; b.pad(4000, 0); let a = []; a.pad(4000, 0); for i in 0..4000 { a[i] = b; }",
            "too large",
        ),
        (
            "let b = []; b.pad(4000, 0); let a = [0]; a[0] = b; let c = [0, 0]; c[0] = a; c[1] = a; c[0] = c;",
            "too large",
        ),
        ("fn f(b) { this[0] = b; } let a = [0]; a.f([1]);", "cannot be read"),
        ("let f = Fn(\"abs\"); loop { f = f.curry(f); }", "cannot be read"),
        ("let f = Fn(\"abs\"); loop { f = curry(f, f); }", "cannot be read"),
        // The native function swallows the error of its callback, and nothing follows it.
        ("let a = [2, 1]; a.sort(|x, y| { loop { } });", "operations"),
        ("jump(grid()[0]); let a = [2, 1]; a.dedup(|x, y| { loop { } })", "operations"),
        ("let a = []; a.pad(1_000_000_000, 0);", "too large"),
        ("let s = \"x\"; s.pad(1_000_000_000, \"x\");", "too large"),
        ("let s = \"\"; s.pad(4000, \"x\"); s.replace(\"x\", s);", "too large"),
        ("eval(\"jump(grid()[0])\");", ""),
        ("import \"x\" as x;", ""),
        ("sleep(1000);", "no function"),
        ("timestamp();", "no function"),
        ("open_file(\"/etc/passwd\");", "no function"),
        ("let f = Fn(\"f\"); fn f(g) { g.call(g) }\nf.call(f);", ""),
        ("throw;", "stopped itself"),
        ("throw \"\\u001b[2J\";", "?[2J"),
        ("loop { order(grid()); }", "more than"),
        ("let a = []; for i in 0..101 { a.push(grid()[0]); }\norder(a);", "at most 100 points"),
        ("dwell(\"5 h\"); jump(grid()[0]);", "at most 14400 s"),
        ("loop { reachable(point(\"250 krpm\", 1.0)); }", "checked"),
    ] {
        let error = error_of(text);
        assert!(error.message.contains(word), "{text}: {error}");
        assert!(!error.to_string().contains('\u{1b}'), "{text}");
    }
    let deep = format!("let a = {}1{};", "(".repeat(100_000), ")".repeat(100_000));
    assert!(error_of(&deep).to_string().len() < 2000);
    let long = format!("let a = \"{}\";", "x".repeat(1 << 20));
    assert!(error_of(&long).message.contains("bytes"));
}

/// A value as deep as an array may be long is shown and dropped without the stack running out.
#[test]
fn deep_values_do_no_harm() {
    let (_, notes, end) =
        play("let a = []; for i in 0..4000 { a = [a]; }\nprint(a); print(a == a); jump(grid()[0]);");
    if let Err(error) = end {
        assert!(error.to_string().contains("too large"), "{error}");
    }
    assert!(notes.iter().all(|note| note.chars().count() <= 500));
}

#[test]
fn notes_are_bounded() {
    let (_, notes, end) = play("for i in 0..5000 { print(i); }");
    end.unwrap();
    assert_eq!(notes.len(), 1000);
    assert!(notes[999].contains("1000 notes"));
}

/// A runner that goes away in mid-run takes its script along, whatever the script catches. The script's side holds the
/// bench, so that the bench is gone when the script is. A script that stays would keep the runner waiting for ever: a
/// minute is some thousand times what it takes.
#[test]
fn a_script_whose_caller_goes_ends() {
    let held = Arc::new(());
    let with_the_script = Arc::clone(&held);
    let order = move |points: &[OperatingPoint]| {
        let _ = &with_the_script;
        Ok(points.to_vec())
    };
    let script =
        Script { path: "test.rhai".into(), text: "loop { try { jump(grid()[0]); } catch { } }".to_owned() };
    let mut runner =
        SequenceRunner::start(script, SequenceRequest { order: Box::new(order), ..request() }).unwrap();
    let step = runner.next_step(None).unwrap().unwrap();
    runner.next_step(Some(answer(&step))).unwrap().unwrap();
    assert_eq!(Arc::strong_count(&held), 2, "the script is at its second jump");
    let (sender, dropped) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        drop(runner);
        sender.send(()).unwrap();
    });
    dropped.recv_timeout(Duration::from_secs(60)).expect("the script goes on without its caller");
    assert_eq!(Arc::strong_count(&held), 1, "the runner has gone and its script has not");
}

/// Refusals that a script swallows cost it operations, and points that are checked in vain are counted: it ends.
#[test]
fn a_script_that_never_takes_no_for_an_answer_ends() {
    let error = error_of("loop { try { jump(point(\"175 krpm\", 0.2)); } catch { } }");
    assert!(error.to_string().contains("operations"), "{error}");
    let error = error_of("loop { reachable(point(\"175 krpm\", 0.2)); }");
    assert!(error.to_string().contains("has checked"), "{error}");
}

/// What a script sets of T3 and oil is in the steps that follow, P3 is what holds the speed with it, and what is beyond a limit is refused.
#[test]
fn t3_and_oil_hold_from_where_they_are_set() {
    let text = r#"
        let p = point("110 krpm", 1.0);
        jump(p);
        oil("90 degC");
        jump(p, "5 min");
        t3("400 degC");
        jump(p);
    "#;
    let run = |text: &str, limits: Limits| {
        let script = Script { path: "test.rhai".into(), text: text.to_owned() };
        let mut runner = SequenceRunner::start(script, SequenceRequest { limits, ..request() }).unwrap();
        let (mut steps, mut last) = (Vec::new(), None);
        while let Some(step) = runner.next_step(last.take()).map_err(|error| error.to_string())? {
            last = Some(answer(&step));
            steps.push(step.step);
        }
        Ok::<_, String>(steps)
    };
    let steps = run(text, request().limits).unwrap();
    let own = BoundaryConditions::default();
    let set: Vec<(f64, f64)> = steps.iter().map(|s| (s.t3_k, s.oil_temperature_k)).collect();
    let (oil_k, t3_k) = (273.15 + 90.0, 273.15 + 400.0);
    assert_eq!(set, [(own.t3_k, own.oil_temperature_k), (own.t3_k, oil_k), (t3_k, oil_k)]);
    // Speed is held: a colder turbine needs more pressure for the same power.
    let boundary = BoundaryConditions { t3_k, oil_temperature_k: oil_k, valve_opening_ratio: 1.0, ..own };
    let held = mapper_physics::simulation::steady::hold_speed(&Model::nominal(), 110e3, &boundary).unwrap();
    assert!((steps[2].p3_pa / held.boundary.p3_pa - 1.0).abs() < 1e-9 && steps[2].p3_pa > steps[1].p3_pa);
    let limits = Limits { t3_max_k: Some(own.t3_k + 10.0), ..request().limits };
    let message = run("t3(\"550 degC\"); jump(point(\"110 krpm\", 1.0));", limits).unwrap_err();
    assert!(message.contains("823.15 K") && message.contains("limit"), "{message}");
    let message = run("oil(\"900 krpm\");", request().limits).unwrap_err();
    assert!(message.contains("krpm"), "{message}");
    let message = run("oil(\"-80 degC\");", request().limits).unwrap_err();
    assert!(message.contains("193.15 K"), "{message}");
    let message = run("oil(\"300 degC\");", request().limits).unwrap_err();
    assert!(message.contains("573.15 K"), "{message}");
    // What a campaign allows and this rig refuses is found at the line of the step.
    let message = run("oil(\"-40 degC\");\njump(point(\"110 krpm\", 1.0));", request().limits).unwrap_err();
    assert!(message.contains("test.rhai:2") && message.contains("T_oil"), "{message}");
}

/// However a loop without an end waits, it ends after a day of rig time.
#[test]
fn a_loop_without_an_end_is_refused() {
    for text in [
        "loop { jump(grid()[0], \"4 h\"); }",
        "loop { settle(grid()[0], \"4 h\"); }",
        "loop { settle(grid()[0], \"60 s\", \"1 K/s\"); }",
    ] {
        let mut runner = start(text);
        let mut last = None;
        let refused = loop {
            match runner.next_step(last.take()) {
                Ok(Some(step)) => last = Some(answer(&step)),
                Ok(None) => panic!("{text} has ended"),
                Err(error) => break error,
            }
            assert!(last.as_ref().unwrap().end_s <= 86_400.0, "{text}");
        };
        assert!(matches!(refused, SequenceError::Script(_)), "{text}: {refused}");
    }
}

/// Dropping a script does not wait until it has used up its operations, wherever it computes.
#[test]
fn a_script_that_computes_ends_when_it_is_dropped() {
    for text in [
        "loop { }",
        "let a = [0]; a.map(|x| { loop { } });",
        "jump(grid()[0]); let a = []; a.pad(4000, 0); a.sort(|x, y| { loop { } });",
    ] {
        let mut runner = start(text);
        runner.request_step(None);
        // Whether it has come to its loop or not: both end.
        runner.is_ready();
        drop(runner);
    }
}

/// A step that is asked for is given once, however often it is looked for.
#[test]
fn a_step_that_is_asked_for_is_given_once() {
    let mut runner = start("for point in grid() { jump(point); }");
    let (mut steps, mut finished) = (0, None);
    loop {
        runner.request_step(finished.take());
        while !runner.is_ready() {}
        assert!(runner.is_ready());
        let Some(step) = runner.next_step(None).unwrap() else { break };
        finished = Some(answer(&step));
        steps += 1;
        if steps > 6 {
            break;
        }
    }
    assert_eq!(steps, 6);
}
