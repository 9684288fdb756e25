//! Reduces tables of steady points (N, flow, P1, T1, P2, T2) to a map with uncertainties. Heat transfer is removed if the housing temperature
//! was measured, or T3 for its heat balance. Tables of turbine points (N, flow, P3, T3, P4, T4) become a turbine map.

use crate::analysis::identification::with_gas;
use crate::machine::identified_machine::with_identified;
use crate::machine::map_work::{MapOut, MapWork, warnings, write_turbine_fitted_if_needed};
use crate::recording::files::{Existing, read_at_most};
use crate::recording::identification_config::{assumed_sensors, identification};
use crate::{
    MapWorkError, Registry, SessionError, recording::run_directory, write_file, write_map_fitted_if_needed,
};
use mapper_campaign::Campaign;
use mapper_core::{
    ImportError, MapDescription, MeasuredPoint, Method, ModelTolerances, PointBudgets, StaticTaps,
    ThermalModel, TurbineMap,
};
use mapper_identify::{IdentifyConfig, KnownHeat, PressureTap, method_of_table};
use mapper_maps::{assemble, mark_line_ends, reduce_turbine};
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_report::{budget_csv, reduced_map, reduced_turbine};
use serde::Deserialize;
use serde_json::json;
use std::path::Path;

struct TestStand {
    name: String,
    config: IdentifyConfig,
    heat: Option<ThermalMachine>,
    remarks: Vec<String>,
}

struct ThermalMachine {
    params: Params,
    tolerances: ModelTolerances,
    boundary: BoundaryConditions,
    origin: String,
}

/// Maximum size of `points.json`, bytes: a thousand points have some 10 MB.
const POINTS_MAX_BYTES: u64 = 256 << 20;

#[derive(Deserialize)]
struct PointsFile {
    thermal: Option<ThermalModel>,
}

impl TestStand {
    fn unknown(table: &Path) -> TestStand {
        let config = IdentifyConfig {
            air: Air::new(Gas::air(), 0.0),
            declared: assumed_sensors(),
            ..IdentifyConfig::default()
        };
        let remark = "No sensors are declared. The uncertainties are assumed: class A of IEC 60751 for temperatures, class 0.1 for pressures and 0.5 % for \
                      the flow. Declare your sensors in a campaign and give it as the machine.";
        let name = table.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        TestStand { name, config, heat: None, remarks: vec![remark.to_owned()] }
    }

    fn read(path: &Path) -> Result<TestStand, SessionError> {
        if !path.is_dir() {
            return Ok(TestStand::of(&mapper_campaign::load(path)?, path, None));
        }
        let campaign = mapper_campaign::load(&path.join(run_directory::CAMPAIGN))?;
        let points = path.join(run_directory::POINTS);
        let bytes = read_at_most(&points, POINTS_MAX_BYTES)?;
        let file: PointsFile = serde_json::from_slice(&bytes)
            .map_err(|error| SessionError::file("read", &points)(error.into()))?;
        Ok(TestStand::of(&campaign, path, file.thermal.as_ref()))
    }

    fn of(campaign: &Campaign, path: &Path, identified: Option<&ThermalModel>) -> TestStand {
        let mut config = identification(campaign);
        let mut tolerances = campaign.tolerances;
        let declared = campaign.machine.params;
        let law = identified.and_then(|identified| Some((identified, identified.convection.as_ref()?)));
        let (params, origin) = match law {
            Some((identified, law)) => {
                let a = &law.coefficient;
                let coefficient_ratio =
                    a.value.map_or(0.0, |value| a.uncertainty.combined_standard_error() / value);
                config.alpha_area_ratio =
                    identified.alpha_area_ratio.value.unwrap_or(config.alpha_area_ratio);
                config.alpha_area_sigma_ratio =
                    identified.alpha_area_ratio.uncertainty.combined_standard_error();
                tolerances.convection_ratio = coefficient_ratio.hypot(law.deviation_ratio);
                (with_identified(&declared, identified), "identified")
            }
            None => (declared, "declared"),
        };
        let origin = format!("{origin} in {}", path.display());
        let heat = Some(ThermalMachine { params, tolerances, boundary: campaign.boundary, origin });
        TestStand { name: campaign.machine.name.clone(), config, heat, remarks: Vec::new() }
    }
}

impl Registry {
    /// Makes a map from a table of steady points. `machine`: a campaign, or a run with a thermal model; `budget`: a new file of uncertainties.
    pub fn reduce_points(
        &self,
        path: &Path,
        user_description: &MapDescription,
        machine: Option<&Path>,
        out: Option<MapOut<'_>>,
        budget: Option<(&Path, Existing)>,
    ) -> Result<MapWork, SessionError> {
        let format = out.map(|out| out.format(self)).transpose()?;
        let TestStand { name, mut config, heat, mut remarks } =
            machine.map_or_else(|| Ok(TestStand::unknown(path)), TestStand::read)?;
        let tap = |tap: PressureTap| match tap {
            PressureTap::Static { pipe_diameter_m } => Some(pipe_diameter_m),
            PressureTap::Total => None,
        };
        let description = MapDescription {
            reference: user_description.reference.or(machine.map(|_| config.reference)),
            static_taps: StaticTaps {
                inlet_diameter_m: user_description.static_taps.inlet_diameter_m.or(tap(config.inlet_tap)),
                outlet_diameter_m: user_description.static_taps.outlet_diameter_m.or(tap(config.outlet_tap)),
            },
            ..user_description.clone()
        };
        let table = match self.inspect_map(path, &description) {
            Err(SessionError::Import(_, ImportError::Turbine { .. })) if budget.is_none() => {
                return self.reduce_turbine_points(path, user_description, machine, out);
            }
            table => table?,
        };
        let measured = table.measured.as_slice();
        if measured.is_empty() {
            return Err(MapWorkError::NotMeasured(path.to_owned()).into());
        }
        config.reference = table.map.reference;
        config.thresholds.end_mean_s = config.thresholds.steady_mean_s;
        config.method = method_of_table(measured, heat.is_some());
        remarks.extend(apparent_efficiency_remark(measured, heat.is_some(), config.method));
        remarks.extend(heat_balance_remark(measured, config.method));
        let known = heat.as_ref().map(|machine| KnownHeat {
            params: &machine.params,
            tolerances: machine.tolerances,
            boundary: &machine.boundary,
            origin: &machine.origin,
        });
        let (points, budgets): (Vec<_>, Vec<PointBudgets>) =
            mapper_identify::reduce(measured, known, &config)?.into_iter().unzip();
        let map = assemble(&points, &name, config.reference, config.method)
            .map_err(|source| MapWorkError::NotAssembled(path.to_owned(), source))?;
        let mut map = with_gas(map, config.air);
        map.wheel_diameter_m = config.wheel_diameter_m;
        let ends = mark_line_ends(&mut map, |step| measured.get(step)?.end);
        let mut document = reduced_map(&map, &ends, &budgets, &remarks);
        let json = json!({
            "points": path,
            "method": config.method,
            "reference": config.reference,
            "efficiency": config.air.efficiency,
            "lines": map.lines,
            "ends": ends,
            "budgets": budgets,
            "remarks": remarks,
            "file": out.map(|out| out.path),
        });
        if let Some((file, existing)) = budget {
            let csv = budget_csv(&budgets).map_err(SessionError::file("write", file))?;
            write_file(file, &csv, existing)?;
        }
        if let Some((out, format)) = out.zip(format) {
            write_map_fitted_if_needed(out.path, format, map, out.existing)?;
            document.facts("", [("map", out.path.display().to_string())]);
        }
        let assumed =
            table.remarks.into_iter().filter(|remark| *remark != mapper_core::ImportRemark::Measured);
        Ok(MapWork { document, json, warnings: warnings(path, &assumed.collect::<Vec<_>>()) })
    }

    /// Makes the map of a turbine from a table of steady points. `machine` is a campaign or run directory with the sensors.
    pub fn reduce_turbine_points(
        &self,
        path: &Path,
        user_description: &MapDescription,
        machine: Option<&Path>,
        out: Option<MapOut<'_>>,
    ) -> Result<MapWork, SessionError> {
        let format = out.map(|out| out.format(self)).transpose()?;
        let TestStand { name, config, remarks, .. } =
            machine.map_or_else(|| Ok(TestStand::unknown(path)), TestStand::read)?;
        let table = self.inspect_turbine(path, user_description.clone())?;
        if table.measured.is_empty() {
            return Err(MapWorkError::NotMeasured(path.to_owned()).into());
        }
        let points = reduce_turbine(&table.measured, &config.declared);
        let mut document = reduced_turbine(&points, &remarks);
        let json = json!({"points": path, "turbine": points, "efficiency": "apparent", "remarks": remarks, "file": out.map(|out| out.path)});
        if let Some((out, format)) = out.zip(format) {
            write_turbine_fitted_if_needed(path, out, format, TurbineMap { machine: name, ..table.map })?;
            document.facts("", [("map", out.path.display().to_string())]);
        }
        Ok(MapWork { document, json, warnings: warnings(path, &table.remarks) })
    }
}

fn heat_balance_remark(measured: &[MeasuredPoint], method: Method) -> Option<String> {
    let without_tc = measured.iter().filter(|point| point.tc_k.is_none()).count();
    (method == Method::Corrected && without_tc > 0).then(|| {
        format!(
            "The housing temperature of {without_tc} of {} points is that of the machine's heat balance with T3 and oil; a measured temperature is more reliable.",
            measured.len()
        )
    })
}

/// The reason why heat transfer was not removed, and the remedy. `None` if it was removed.
fn apparent_efficiency_remark(measured: &[MeasuredPoint], has_heat: bool, method: Method) -> Option<String> {
    let without_tc = measured.iter().filter(|point| point.tc_k.or(point.turbine.t3_k).is_none()).count();
    let reason = match (method, has_heat) {
        (Method::Corrected, _) => return None,
        (_, false) if without_tc == 0 => {
            "the table has the housing temperature or T3, but the convection of the machine is unknown; give its campaign or a run as the machine"
                .to_owned()
        }
        _ if without_tc == measured.len() => {
            "the table has neither the housing temperature (Tc) nor T3; the heat correction of maps estimates the heat from the speed lines".to_owned()
        }
        _ => {
            format!("{without_tc} of {} points have neither a housing temperature (Tc) nor T3; add one, or remove these points", measured.len())
        }
    };
    Some(format!("The efficiencies are apparent, heat transfer included: {reason}."))
}
