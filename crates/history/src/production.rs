//! Statistics of a production: the average machine, the scatter between machines, and drift of the test stand.

use crate::outlier::{Deviations, Outlier, find_outliers};
use crate::{ObservedPoint, PointQuantity, StoredNight};
use mapper_numerics::mixed_model::{Effect, MixedFit, MixedModel};
use mapper_numerics::statistics::mean;
use nalgebra::DMatrix;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

/// Minimum number of nights for a drift: two always lie on a line.
const MIN_NIGHTS_FOR_DRIFT: usize = 3;
/// Milliseconds of a day.
pub const MS_PER_DAY: f64 = 86_400_000.0;

/// Results of many machines, measured with one campaign and method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Production {
    /// The campaign.
    pub campaign: String,
    /// Method of identification.
    pub method: String,
    /// Runs with points.
    pub runs: usize,
    /// The machines, by name.
    pub machines: Vec<String>,
    /// Start times of the nights, ms since 1970-01-01 00:00 UTC, ascending.
    pub nights_ms: Vec<i64>,
    /// The points of the map by speed and opening, without outliers.
    pub places: Vec<ProductionPoint>,
    /// Effect of the stand on all machines, mean over the points; `None` for a single night.
    pub stand: Option<Stand>,
    /// Machines that deviate from the others, largest deviation first; `None` if there are too few machines.
    pub outliers: Option<Vec<Outlier>>,
}

/// One point of the map over the production.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProductionPoint {
    /// Target speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening relative to the nominal area.
    pub valve_opening_ratio: f64,
    /// Efficiency, fraction; standard deviations are fractions too.
    pub eta: Option<Spread>,
    /// Heat-transfer coefficient, W/(m2 K); standard deviations are ratios of it.
    pub h_w_m2k: Option<Spread>,
}

/// Mean and scatter of a quantity.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spread {
    /// Value of the average machine.
    pub mean: f64,
    /// Standard deviation between machines; `None` if each was measured once: it is then part of `residual_sigma`.
    pub machine_sigma: Option<f64>,
    /// Standard deviation between nights without the drift; `None` for a single night.
    pub night_sigma: Option<f64>,
    /// Standard deviation of one measurement of one machine in one night.
    pub residual_sigma: f64,
}

/// Effect of the stand on all machines.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stand {
    /// Drift of the efficiency, fraction per day; `None` for fewer than 3 nights.
    pub eta_drift: Option<Drift>,
    /// Relative drift of h, ratio per day.
    pub h_drift: Option<Drift>,
    /// Standard deviation of the efficiency between nights in addition to the drift, fraction.
    pub eta_night_sigma: f64,
    /// The same of h, ratio.
    pub h_night_sigma: f64,
}

/// A change per day, with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Drift {
    /// Change per day.
    pub a_day: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Analyses the production of each campaign and method in a history.
pub fn analyse_productions(nights: &[StoredNight], points: &[ObservedPoint]) -> Vec<Production> {
    let starts: BTreeMap<i64, i64> = nights.iter().map(|night| (night.id, night.started_ms)).collect();
    let mut by_key: BTreeMap<(&str, &str), Vec<&ObservedPoint>> = BTreeMap::new();
    for point in points {
        by_key.entry((&point.key.campaign, &point.key.method)).or_default().push(point);
    }
    by_key
        .into_iter()
        .filter_map(|((campaign, method), points)| analyse_production(campaign, method, &starts, &points))
        .collect()
}

/// Observations of one point of the map.
struct PointObservations<'a> {
    points: Vec<&'a ObservedPoint>,
    machines: Vec<usize>,
    nights: Vec<usize>,
    days: Vec<f64>,
}

fn analyse_production(
    campaign: &str,
    method: &str,
    starts: &BTreeMap<i64, i64>,
    points: &[&ObservedPoint],
) -> Option<Production> {
    let machines: Vec<String> =
        points.iter().map(|point| point.key.machine.clone()).collect::<BTreeSet<_>>().into_iter().collect();
    let nights_ms: Vec<i64> = points
        .iter()
        .filter_map(|point| starts.get(&point.night_id).copied())
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect();
    let first_ms = *nights_ms.first()?;
    let runs: BTreeSet<(i64, &str, u64)> =
        points.iter().map(|point| (point.night_id, point.key.machine.as_str(), point.key.seed)).collect();
    let mut by_operating_point: BTreeMap<(u64, u64), PointObservations<'_>> = BTreeMap::new();
    for &point in points {
        let key = (point.point.speed_rpm.to_bits(), point.point.valve_opening_ratio.to_bits());
        let (Ok(machine), Some(start)) =
            (machines.binary_search(&point.key.machine), starts.get(&point.night_id))
        else {
            continue;
        };
        let Ok(night) = nights_ms.binary_search(start) else { continue };
        let observed = by_operating_point.entry(key).or_insert_with(|| PointObservations {
            points: Vec::new(),
            machines: Vec::new(),
            nights: Vec::new(),
            days: Vec::new(),
        });
        observed.points.push(point);
        observed.machines.push(machine);
        observed.nights.push(night);
        observed.days.push((start - first_ms) as f64 / MS_PER_DAY);
    }
    let observations: Vec<PointObservations<'_>> = by_operating_point.into_values().collect();
    let no_machines = BTreeSet::new();
    let measured = fit_places(&observations, machines.len(), &no_machines);
    let outliers = find_outliers(&machines, &measured.deviations);
    let outlier_machines: BTreeSet<usize> = outliers
        .iter()
        .flatten()
        .filter_map(|outlier| machines.binary_search(&outlier.machine).ok())
        .collect();
    let measured = if outlier_machines.is_empty() {
        measured
    } else {
        fit_places(&observations, machines.len(), &outlier_machines)
    };
    Some(Production {
        campaign: campaign.to_owned(),
        method: method.to_owned(),
        runs: runs.len(),
        stand: (nights_ms.len() > 1).then(|| stand(&measured)),
        machines,
        nights_ms,
        places: measured.places,
        outliers,
    })
}

/// The fits of all points of the map.
struct ProductionFit {
    places: Vec<ProductionPoint>,
    deviations: Vec<Deviations>,
    eta: Vec<PointFit>,
    h: Vec<PointFit>,
}

fn fit_places(
    observations: &[PointObservations<'_>],
    machines: usize,
    excluded: &BTreeSet<usize>,
) -> ProductionFit {
    let mut measured =
        ProductionFit { places: Vec::new(), deviations: Vec::new(), eta: Vec::new(), h: Vec::new() };
    for observed in observations {
        let Some(first) = observed.points.first() else { continue };
        let eta = fit_place(observed, PointQuantity::Eta, excluded, |eta| eta);
        let h = fit_place(observed, PointQuantity::H, excluded, f64::ln);
        let (speed_rpm, valve_opening_ratio) = (first.point.speed_rpm, first.point.valve_opening_ratio);
        measured.deviations.push(Deviations {
            speed_rpm,
            eta_mean: eta.as_ref().map_or(f64::NAN, PointFit::mean),
            eta: deviations(observed, PointQuantity::Eta, eta.as_ref(), machines, |eta| eta),
            ln_h: deviations(observed, PointQuantity::H, h.as_ref(), machines, f64::ln),
        });
        measured.places.push(ProductionPoint {
            speed_rpm,
            valve_opening_ratio,
            eta: eta.as_ref().map(|fitted| fitted.spread(fitted.mean())),
            h_w_m2k: h.as_ref().map(|fitted| fitted.spread(fitted.mean().exp())),
        });
        measured.eta.extend(eta);
        measured.h.extend(h);
    }
    measured
}

/// A mixed model of one quantity at one point of the map.
struct PointFit {
    fit: MixedFit,
    /// Index of machines and of nights among the groups of the model.
    machines: Option<usize>,
    nights: Option<usize>,
    with_drift: bool,
    mean_day: f64,
}

impl PointFit {
    fn mean(&self) -> f64 {
        self.fit.coefficients[0].value
    }

    fn spread(&self, mean: f64) -> Spread {
        let sigma = |group: Option<usize>| group.map(|group| self.fit.group_sigmas[group]);
        Spread {
            mean,
            machine_sigma: sigma(self.machines),
            night_sigma: sigma(self.nights),
            residual_sigma: self.fit.residual_sigma,
        }
    }

    fn drift(&self) -> Option<Effect> {
        self.with_drift.then(|| self.fit.coefficients[1])
    }

    fn stand_shift(&self, night: usize, day: f64) -> f64 {
        let scatter = self
            .nights
            .map_or(0.0, |group| self.fit.effects[group].get(night).map_or(0.0, |effect| effect.value));
        scatter + self.drift().map_or(0.0, |drift| drift.value * (day - self.mean_day))
    }
}

fn fit_place(
    observed: &PointObservations<'_>,
    quantity: PointQuantity,
    excluded: &BTreeSet<usize>,
    transform: fn(f64) -> f64,
) -> Option<PointFit> {
    let kept: Vec<(usize, f64)> = (0..observed.points.len())
        .filter(|i| !excluded.contains(&observed.machines[*i]))
        .filter_map(|i| Some((i, transform(quantity.of(&observed.points[i].point)?))))
        .filter(|(_, value)| value.is_finite())
        .collect();
    let y: Vec<f64> = kept.iter().map(|(_, value)| *value).collect();
    let select_kept = |from: &[usize]| kept.iter().map(|(i, _)| from[*i]).collect::<Vec<usize>>();
    let (machines, nights) = (select_kept(&observed.machines), select_kept(&observed.nights));
    let count_distinct = |levels: &[usize]| levels.iter().collect::<BTreeSet<_>>().len();
    let days: Vec<f64> = kept.iter().map(|(i, _)| observed.days[*i]).collect();
    let with_drift = count_distinct(&nights) >= MIN_NIGHTS_FOR_DRIFT;
    let mean_day = mean(&days)?;
    let fixed = DMatrix::from_fn(y.len(), 1 + usize::from(with_drift), |row, column| {
        if column == 0 { 1.0 } else { days[row] - mean_day }
    });
    // With one measurement per machine, the deviation of a machine is indistinguishable from the residual.
    let with_machines = count_distinct(&machines) < y.len() && count_distinct(&machines) > 1;
    let with_nights = count_distinct(&nights) > 1 && count_distinct(&nights) < y.len();
    let mut groups: Vec<&[usize]> = Vec::new();
    let (mut of_machines, mut of_nights) = (None, None);
    if with_machines {
        of_machines = Some(groups.len());
        groups.push(&machines);
    }
    if with_nights {
        of_nights = Some(groups.len());
        groups.push(&nights);
    }
    let single_group = vec![0; y.len()];
    if groups.is_empty() {
        groups.push(&single_group);
    }
    let fit = MixedModel { y: &y, fixed, groups }.fit().ok()?;
    Some(PointFit { fit, machines: of_machines, nights: of_nights, with_drift, mean_day })
}

/// Deviation of each machine from the average machine, after subtracting the shift by the stand; `None` if it was not measured.
fn deviations(
    observed: &PointObservations<'_>,
    quantity: PointQuantity,
    fitted: Option<&PointFit>,
    machines: usize,
    transform: fn(f64) -> f64,
) -> Vec<Option<f64>> {
    let Some(fitted) = fitted else { return vec![None; machines] };
    let mut of_machine: Vec<Vec<f64>> = vec![Vec::new(); machines];
    for (i, point) in observed.points.iter().enumerate() {
        let Some(value) = quantity.of(&point.point).map(transform).filter(|value| value.is_finite()) else {
            continue;
        };
        let stand = fitted.stand_shift(observed.nights[i], observed.days[i]);
        of_machine[observed.machines[i]].push(value - fitted.mean() - stand);
    }
    of_machine.iter().map(mean).collect()
}

/// Effect of the stand, mean over all points. The points share its errors, so the standard error does not decrease with their number.
fn stand(measured: &ProductionFit) -> Stand {
    let drift = |fitted: &[PointFit]| {
        let drifts: Vec<Effect> = fitted.iter().filter_map(PointFit::drift).collect();
        let a_day = mean(drifts.iter().map(|drift| drift.value))?;
        let half = 1.96 * mean(drifts.iter().map(|drift| drift.standard_error))?;
        Some(Drift { a_day, low: a_day - half, high: a_day + half })
    };
    let sigma = |fitted: &[PointFit]| {
        mean(fitted.iter().filter_map(|effect| effect.nights.map(|group| effect.fit.group_sigmas[group])))
            .unwrap_or(0.0)
    };
    Stand {
        eta_drift: drift(&measured.eta),
        h_drift: drift(&measured.h),
        eta_night_sigma: sigma(&measured.eta),
        h_night_sigma: sigma(&measured.h),
    }
}
