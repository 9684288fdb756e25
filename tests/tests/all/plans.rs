//! What a plan says comes true on the virtual lab, whatever it was ordered by.

use mapper_tests::{BY_ITSELF, CampaignFile, SHORT_GRID, mapper, repository};
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
        .chain(BY_ITSELF.iter().copied())
        .chain([("order: information ", order.as_str())])
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
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// Every order passes the guards (a run that trips one exits with another code), and each jump moves T2 as forecast: what
/// is left is that identification takes means over 2 s at both ends where the forecast takes instants, that the lab's P3
/// lags by 0.3 s, and the noise of these means, about 0.1 K.
#[test]
fn every_order_passes_the_guards_and_moves_t2_as_forecast() {
    for order in ["listed", "greedy", "sum_gradient", "worst_gradient", "information", "time"] {
        let sigma = [("seed: 1 ", "required_sigma_eta: 2 %\nseed: 1 ")];
        let window = ("window: auto ", "window: {start: 10 s, end: 40 s} ");
        let fixed = [sigma[0], window];
        let campaign = campaign(order, if order == "time" { &fixed } else { &fixed[1..] });
        let planned = plan(&campaign);
        let steps = planned["steps"].as_array().unwrap();
        let result = run(&campaign);
        let points = result["points"].as_array().unwrap();
        assert_eq!(points.len(), steps.len(), "{order}");
        for (step, point) in steps.iter().zip(points).skip(1) {
            let (forecast_k, measured_k) = (number(&step["predicted"]["dt2_k"]), number(&point["dt2_k"]));
            let allowed_k = 0.05 * forecast_k.abs() + 0.4;
            assert!(
                (measured_k - forecast_k).abs() < allowed_k,
                "{order}: {measured_k} K for {forecast_k} K"
            );
        }
        // A bound is never below what was found; what is not known is said.
        let (figures, bound) = (&planned["figures"], &planned["bound"]);
        if bound.is_object() {
            assert!(number(&figures["sum_gradient_k"]) <= number(&bound["sum_gradient_k"]), "{order}");
            assert!(number(&figures["worst_gradient_k"]) <= number(&bound["worst_gradient_k"]), "{order}");
        }
        let known = ["sum_gradient", "worst_gradient"].contains(&order);
        assert_eq!(planned["bound_remark"].is_null(), known, "{order}");
        assert!(bound.is_object() || !known, "{order}");
    }
}

/// Each order is the best by its own figure.
#[test]
fn orders_do_what_they_are_for() {
    let required = [("seed: 1 ", "required_sigma_eta: 2.5 %\nseed: 1 ")];
    let of = |order: &str| plan(&campaign(order, if order == "time" { &required } else { &[] }));
    let (information, sum, time) = (of("information"), of("sum_gradient"), of("time"));
    let error = |plan: &Value| number(&plan["figures"]["rms_error_eta"]);
    // The order is found on the reduced housing; in full it may be off in the third digit.
    assert!(error(&information) <= 1.005 * error(&sum), "{} {}", error(&information), error(&sum));
    let minutes = |plan: &Value| number(&plan["figures"]["minutes"]);
    assert!(minutes(&time) < minutes(&information) && minutes(&time) < minutes(&sum));
    // Where it has cut a dwell short, the error is still the required one.
    for step in time["steps"].as_array().unwrap().iter().skip(1) {
        let predicted = &step["predicted"];
        let error = number(&predicted["sigma_eta"]).hypot(number(&predicted["bias_eta"]));
        assert!(error <= 0.025 || number(&predicted["minutes"]) == 2.0, "{step}");
    }
}

/// The standard error that the plan states is the scatter of what is found: 48 seeds draw noise and offsets again. The
/// standard deviation of 48 is itself known to 10.3 %; three of that, beside 4 % by which the prediction may be off: over 300
/// seeds the ratios were 0.95 and 0.95, which are known to 4 % themselves.
#[test]
fn predicted_errors_are_the_scatter_of_seeded_runs() {
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
    for seed in 1..=48 {
        for (step, point) in run(&text(seed))["points"].as_array().unwrap().iter().enumerate().skip(1) {
            found[step].push(number(&point["eta"]));
        }
    }
    for (step, etas) in found.iter().enumerate().skip(1) {
        let mean = etas.iter().sum::<f64>() / etas.len() as f64;
        let square = etas.iter().map(|eta| (eta - mean).powi(2)).sum::<f64>() / (etas.len() as f64 - 1.0);
        let ratio = square.sqrt() / number(&planned["steps"][step]["predicted"]["sigma_eta"]);
        assert!((ratio - 1.0).abs() < 0.35, "step {step}: the scatter is {ratio} of the prediction");
    }
}

/// What a gap diagnosis asks for can be run: stored behind a plan, run with it, and kept out of the map.
#[test]
fn an_appended_jump_is_run_behind_the_points() {
    let campaign = campaign("listed", &[]);
    let stored = campaign.directory().join("plan.json");
    let (file, out) = (campaign.path.as_os_str(), campaign.runs());
    let append = ["plan".as_ref(), file, "--out".as_ref(), stored.as_os_str(), "--append".as_ref()];
    let made = mapper(append.into_iter().chain(["140krpm@0.7".as_ref(), "65krpm@1.4".as_ref()])).exits(0);
    assert!(made.stdout.contains("made after all else"), "{}", made.stdout);
    let arguments =
        ["run".as_ref(), file, "--plan".as_ref(), stored.as_os_str(), "--json".as_ref(), "--out".as_ref()];
    let result = mapper(arguments.into_iter().chain([out.as_os_str()])).exits(0).json();
    let points = result["points"].as_array().unwrap();
    let last = points.last().unwrap();
    assert_eq!(points.len(), 8, "six points, the start of the jump and its target");
    assert_eq!((last["kind"].as_str(), number(&last["valve"])), (Some("repeat"), 1.4));
}

/// A plan that its own comparison beats says so, and `best` takes what beats it.
#[test]
fn a_plan_that_another_order_beats_says_so() {
    let plan = |more: &[(&str, &str)]| {
        let text = std::fs::read_to_string(repository().join("campaigns/grid18.yaml")).unwrap();
        let campaign =
            CampaignFile::of(more.iter().fold(text, |text, (old, new)| text.replacen(old, new, 1)));
        mapper(["plan".as_ref(), campaign.path.as_os_str(), "--json".as_ref()]).exits(0).json()
    };
    // Each step by itself: with 100 s of samples large gradients are no gain.
    let gradients = plan(&[]);
    let said = gradients["remarks"]
        .as_array()
        .unwrap()
        .iter()
        .any(|remark| remark.as_str().unwrap().contains("` is forecast to do better"));
    assert!(said, "{}", gradients["remarks"]);
    let best = plan(&[("order: sum_gradient", "order: best")]);
    let error = |plan: &Value| plan["figures"]["rms_error_eta"].as_f64().unwrap();
    assert!(error(&best) < error(&gradients), "{} and {}", error(&best), error(&gradients));
}
