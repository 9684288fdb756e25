//! The forecasts of a plan agree with runs on the virtual lab, for every order.

use mapper_tests::{CampaignFile, SHORT_GRID, SINGLE_STEP_METHOD, mapper};
use serde_json::Value;

/// Six points of the shipped campaign, ordered by `order`.
fn campaign(order: &str, more: &[(&str, &str)]) -> CampaignFile {
    let order = format!("order: {order} ");
    let wider: Vec<(&str, &str)> = SHORT_GRID
        .iter()
        .map(|(old, new)| {
            (
                *old,
                if *new == "speeds: [80 krpm, 125 krpm]" {
                    "speeds: [65 krpm, 95 krpm, 140 krpm]"
                } else {
                    *new
                },
            )
        })
        .chain(SINGLE_STEP_METHOD.iter().copied())
        .chain([("order: thermal_gradient ", order.as_str())])
        .chain(more.iter().copied())
        .collect();
    CampaignFile::shipped_with(&wider)
}

fn plan(campaign: &CampaignFile) -> Value {
    mapper(["plan".as_ref(), campaign.path.as_os_str(), "--json".as_ref()]).exits(0).json()
}

fn run(campaign: &CampaignFile) -> Value {
    let out = campaign.runs();
    let arguments =
        ["run".as_ref(), campaign.path.as_os_str(), "--json".as_ref(), "--out".as_ref(), out.as_os_str()];
    mapper(arguments).exits(0).json()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// Every order passes the guards (a run that trips one exits with another code), and each jump moves T2 as forecast: what
/// is left is that identification takes means over 2 s at both ends where the forecast takes instants, that the lab's P3
/// lags by 0.3 s, and the noise of these means, about 0.1 K.
#[test]
fn every_order_passes_the_guards_and_moves_t2_as_forecast() {
    for order in ["listed", "thermal_gradient", "speed_lines"] {
        let window = ("window: auto ", "window: {start: 10 s, end: 40 s} ");
        let campaign = campaign(order, &[window]);
        let planned = plan(&campaign);
        let steps = planned["steps"].as_array().unwrap();
        let result = run(&campaign);
        let points = result["points"].as_array().unwrap();
        assert_eq!(points.len(), steps.len(), "{order}");
        for (step, point) in steps.iter().zip(points).skip(1) {
            let (forecast_k, measured_k) = (number(&step["predicted"]["dt2_k"]), number(&point["dt2_k"]));
            // The run follows the readings of its stand on the ramps, which shifts the start of the change by some tenths of a second.
            let allowed_k = 0.1 * forecast_k.abs() + 0.4;
            assert!(
                (measured_k - forecast_k).abs() < allowed_k,
                "{order}: {measured_k} K for {forecast_k} K"
            );
        }
    }
}

/// Each order is the best by its own figure, and each kind of dwell keeps its requirement.
#[test]
fn orders_and_dwells_improve_what_they_are_chosen_for() {
    let [total, lines] = ["thermal_gradient", "speed_lines"].map(|order| plan(&campaign(order, &[])));
    let figure = |plan: &Value, name: &str| number(&plan["figures"][name]);
    // The order is found on the reduced housing; in full it may be off in the third digit.
    assert!(figure(&total, "sum_gradient_k") >= 0.999 * figure(&lines, "sum_gradient_k"));
    let dwell = |text: &'static str| plan(&campaign("thermal_gradient", &[("dwell: 120 s ", text)]));
    assert!(figure(&dwell("time_budget: 12 min "), "minutes") <= 12.0);
    let required = dwell("required_sigma_eta: 2.5 % ");
    assert!(figure(&required, "rms_error_eta") <= 0.025);
    assert!(figure(&required, "minutes") < figure(&total, "minutes"));
}

/// The standard error that the plan states is the scatter of what is found: 12 seeds draw noise and offsets again. The
/// standard deviation of 12 is itself known to 21 %; three of that, in addition to 4 % by which the prediction may be off: over 300
/// seeds the ratios were 0.95 and 0.95, which are known to 4 % themselves.
#[test]
fn predicted_errors_match_the_scatter_of_seeded_runs() {
    let small: &[(&str, &str)] = &[("openings: [0.7, 1.4]", "openings: [1.0]")];
    let text = |seed: usize| {
        let mut campaign = campaign("listed", &[]).text;
        for (old, new) in small {
            campaign = campaign.replace(old, new);
        }
        CampaignFile::of(campaign.replace("seed: 1 ", &format!("seed: {seed} ")))
    };
    let planned = plan(&text(1));
    let mut found: Vec<Vec<f64>> = vec![Vec::new(); 3];
    for seed in 1..=12 {
        for (step, point) in run(&text(seed))["points"].as_array().unwrap().iter().enumerate().skip(1) {
            found[step].push(number(&point["eta"]));
        }
    }
    for (step, etas) in found.iter().enumerate().skip(1) {
        let mean = etas.iter().sum::<f64>() / etas.len() as f64;
        let square = etas.iter().map(|eta| (eta - mean).powi(2)).sum::<f64>() / (etas.len() as f64 - 1.0);
        let ratio = square.sqrt() / number(&planned["steps"][step]["predicted"]["sigma_eta"]);
        assert!((ratio - 1.0).abs() < 0.67, "step {step}: the scatter is {ratio} of the prediction");
    }
}

/// What a gap diagnosis asks for can be run: stored behind a plan, run with it, and kept out of the map.
#[test]
fn an_appended_jump_is_run_behind_the_points() {
    let campaign = campaign("listed", &[]);
    let stored = campaign.directory().join("plan.json");
    let (file, out) = (campaign.path.as_os_str(), campaign.runs());
    let append = ["plan".as_ref(), file, "--out".as_ref(), stored.as_os_str(), "--append".as_ref()];
    mapper(append.into_iter().chain(["140krpm@0.7".as_ref(), "65krpm@1.4".as_ref()])).exits(0);
    let arguments =
        ["run".as_ref(), file, "--plan".as_ref(), stored.as_os_str(), "--json".as_ref(), "--out".as_ref()];
    let result = mapper(arguments.into_iter().chain([out.as_os_str()])).exits(0).json();
    let points = result["points"].as_array().unwrap();
    let last = points.last().unwrap();
    assert_eq!(points.len(), 8, "six points, the start of the jump and its target");
    assert_eq!((last["kind"].as_str(), number(&last["valve"])), (Some("repeat"), 1.4));
}
