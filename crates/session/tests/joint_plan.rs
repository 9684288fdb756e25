//! Plans for the joint method, held against what its fits of simulated recordings then give.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "common/shipped.rs"]
mod shipped;

use mapper_backends::virtual_lab;
use mapper_campaign::Campaign;
use mapper_core::{Plan, VisitOrder};
use mapper_formats::FORMATS;
use mapper_planner::error_bound;
use mapper_session::{
    Registry, RunRequest, Session, SessionError, compared, nominal_model, plan, plan_of, with_plan_request,
};
use shipped::campaign;

const GRID: [(&str, &str); 3] = [
    (
        "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
        "speeds: [50 krpm, 80 krpm, 110 krpm, 140 krpm]",
    ),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0, 2.0]"),
    ("seed: 1  ", "repeats: off\nseed: 1  "),
];

fn small(more: &[(&str, &str)]) -> Campaign {
    campaign(&[&GRID[..], more].concat())
}

fn planned(campaign: &Campaign) -> Plan {
    plan(campaign, &nominal_model(campaign).unwrap()).unwrap()
}

const ANY_ERROR: (&str, &str) = ("required_sigma_eta: 0.5 %\n", "");

/// The rms of the errors is the forecast's, within what the draws of what all points share know of it: of 18 a standard
/// deviation to 17 %, three of which are half.
#[test]
fn seeds_err_as_forecast() {
    let steps_of_40_s = ("dwell: 120 s ", "dwell: 40 s ");
    let first = small(&[ANY_ERROR, steps_of_40_s]);
    let forecast = planned(&first).figures.rms_error_eta.unwrap();
    let registry = Registry { backends: vec![virtual_lab::PLUGIN], formats: FORMATS, ..Registry::default() };
    let session = Session::new(&registry);
    let (mut square, mut count) = (0.0, 0.0);
    for seed in 1..=18 {
        // The same plan, whatever its seed would search.
        let campaign = Campaign { seed, order: VisitOrder::SpeedLines, ..first.clone() };
        let folder = tempfile::tempdir().unwrap();
        let results = session.run(RunRequest::new(&campaign, "", folder.path())).unwrap().results.unwrap();
        for scored in &results.points {
            if let (Some(eta), Some(truth)) = (scored.point.eta, &scored.truth) {
                square += (eta - truth.eta).powi(2);
                count += 1.0;
            }
        }
    }
    let lines = planned(&Campaign { order: VisitOrder::SpeedLines, ..first }).figures.rms_error_eta.unwrap();
    let ratio = f64::sqrt(square / count) / lines;
    assert!(
        count >= 18.0 * 12.0 && (0.5..1.5).contains(&ratio),
        "{ratio} of {lines}, {forecast} by information"
    );
}

/// More time tells more, and nothing that the method can find makes a point more certain when it has to be found.
#[test]
fn an_open_error_is_never_the_smaller_one_and_falls_with_time() {
    let mut before = f64::INFINITY;
    for dwell in ["dwell: 30 s ", "dwell: 60 s ", "dwell: 120 s "] {
        let plan = planned(&small(&[
            ANY_ERROR,
            ("dwell: 120 s ", dwell),
            ("order: information ", "order: speed_lines "),
        ]));
        for step in &plan.steps {
            let (sigma, open) = (step.predicted.sigma_eta.unwrap(), step.predicted.open_sigma_eta.unwrap());
            // Smoothness is weighed again for each: a hundredth.
            assert!(open > 0.99 * sigma, "{}: {open} and {sigma}", step.to);
        }
        let open = plan.figures.open_rms_error_eta.unwrap();
        assert!(open < before, "{dwell}: {open} after {before}");
        before = open;
    }
}

#[test]
fn steps_last_as_long_as_the_required_error_takes() {
    let longest = planned(&small(&[ANY_ERROR]));
    let reachable = longest.figures.open_rms_error_eta.unwrap();
    let required = 1.5 * reachable;
    let campaign = Campaign { required_sigma_eta: Some(required), ..small(&[]) };
    let shorter = planned(&campaign);
    let error = shorter.figures.open_rms_error_eta.unwrap();
    assert!(shorter.figures.minutes < 0.8 * longest.figures.minutes, "{} min", shorter.figures.minutes);
    // Two percent above counts as reached; far below would be time for nothing. Whole seconds are 3 % of the shortest step.
    assert!((0.9 * required..1.021 * required).contains(&error), "{error}, required {required}");
    for step in &shorter.steps {
        let rest_s = step.dwell_s - step.predicted.settle_s.unwrap();
        assert!(rest_s >= 0.25 * step.dwell_s || step.dwell_s >= 120.0, "{}: {rest_s} s", step.to);
    }
    let impossible = planned(&Campaign { required_sigma_eta: Some(0.1 * reachable), ..campaign });
    assert!(
        impossible.remarks.iter().any(|remark| remark.contains("that are required")),
        "{:?}",
        impossible.remarks
    );
}

/// `best` is the first of the list that `--compare` prints, and jumps tell more than speed lines of equal length.
#[test]
fn the_best_order_is_the_best_of_those_compared() {
    let campaign =
        small(&[ANY_ERROR, ("dwell: 120 s ", "dwell: 40 s "), ("order: information ", "order: best ")]);
    let model = nominal_model(&campaign).unwrap();
    let best = planned(&campaign);
    let comparison =
        with_plan_request(&campaign, &model, |request| compared(&campaign, request, &best)).unwrap();
    let cost = |way: &mapper_planner::WayOfMapping| way.open_rms_error_eta.unwrap().powi(2) * way.minutes;
    let costs: Vec<f64> = comparison.orders.iter().map(|(_, way)| cost(way)).collect();
    assert!(cost(&comparison.proposed) <= costs[0] * (1.0 + 1e-9), "{costs:?}");
    let open = |name: &str| comparison.of_order(name).unwrap().open_rms_error_eta.unwrap();
    assert!(open("information") < open("speed_lines"), "jumps move the housing, and that is what tells");
}

/// Of four points at three speeds each order is made and judged by what all its steps tell: none is below the bound of any.
#[test]
fn no_order_is_below_the_bound_of_its_error() {
    let first = small(&[
        ANY_ERROR,
        ("dwell: 120 s ", "dwell: 60 s "),
        ("speeds: [50 krpm, 80 krpm, 110 krpm, 140 krpm]", "speeds: [50 krpm, 90 krpm, 140 krpm]"),
        ("openings: [0.5, 1.0, 2.0]", "openings: [0.6, 1.5]"),
    ]);
    let model = nominal_model(&first).unwrap();
    let mut bounds = Vec::new();
    for order in orders(4) {
        let points = order.iter().map(|place| first.points[*place]).collect();
        let campaign = Campaign { order: VisitOrder::Listed, points, ..first.clone() };
        let bound = with_plan_request(&campaign, &model, |request| {
            Ok::<_, SessionError>(error_bound(request, &plan_of(&campaign, request)?)?.unwrap())
        });
        bounds.push(bound.unwrap());
    }
    let (least, most) = bounds.iter().fold((f64::INFINITY, 0.0), |(low, high), bound| {
        (bound.error_eta.min(low), bound.error_eta.max(high))
    });
    let highest = bounds.iter().map(|bound| bound.least_error_eta).fold(0.0, f64::max);
    assert!(highest <= least, "a bound of {highest}, and an order has {least}");
    // The orders differ, and the bound says something.
    assert!(most > 1.1 * least && highest > 0.3 * least, "{least} to {most}, bounds to {highest}");
}

/// All orders of the first so many numbers.
fn orders(count: usize) -> Vec<Vec<usize>> {
    let Some(last) = count.checked_sub(1) else { return vec![Vec::new()] };
    let put = |order: Vec<usize>| {
        (0..=order.len()).map(move |place| [&order[..place], &[last], &order[place..]].concat())
    };
    orders(last).into_iter().flat_map(put).collect()
}
