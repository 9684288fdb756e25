//! Commands and options that carry out the remedies of library errors, which name none themselves.

use mapper_core::{ExportError, ImportError};
use mapper_fleet::FleetError;
use mapper_history::HistoryError;
use mapper_maps::HeatCorrectionError as Heat;
use mapper_recording::RecordError;
use mapper_session::{FirstMapError, FmuExportError, MapWorkError, SessionError as E};

/// The command or option for the remedy in the error's message; `None` if there is none.
pub fn command_for(error: &E) -> Option<String> {
    let fixed = match error {
        E::RigAbandoned { rig, run, .. } => {
            let acknowledge = acknowledge_command(rig);
            return Some(format!("`mapper run --resume {}`, or {acknowledge}", run.display()));
        }
        E::RigLockedOut { rig, .. } => return Some(acknowledge_command(rig)),
        E::DifferentCampaigns { .. } | E::MachineUnknown { channel_map_suffices: false } => {
            "`--campaign FILE`"
        }
        E::MachineUnknown { channel_map_suffices: true } => "`--campaign FILE`, or `--channels FILE`",
        E::Record(RecordError::LogWithoutMap { path }) => {
            let log = path.display();
            return Some(format!(
                "`--channels FILE`; `mapper log inspect {log} --write-channels FILE` proposes a channel map"
            ));
        }
        E::StalePlan { .. } | E::InvalidPlan { .. } => "`mapper plan CAMPAIGN --out FILE`",
        E::UnknownOutputFormat { .. } => "`--to FORMAT`",
        E::FirstMap(error) if matches!(**error, FirstMapError::NotAMap(..)) => "`mapper map convert`",
        E::Fmu(FmuExportError::Platform | FmuExportError::Compiler { .. }) => "without `--compile`",
        E::MapWork(MapWorkError::NotMeasured(_)) => "`mapper map inspect`",
        E::MapWork(MapWorkError::NotCorrected(
            _,
            Heat::TooFew { .. } | Heat::OneSpeed { .. } | Heat::Singular,
        )) => "`--heat WATTS`",
        E::MapWork(MapWorkError::NoDefinition) => "`--efficiency DEFINITION`",
        E::Import(_, source) => match source {
            ImportError::NoUnit { .. } | ImportError::FlowUnit => "`--with KEY=VALUE`",
            ImportError::RelativeSpeed { .. } | ImportError::DesignSpeedUnused { .. } => "`--design-speed`",
            ImportError::NoReference | ImportError::ReferenceConflict { .. } => "`--reference`",
            _ => return None,
        },
        E::Export(ExportError::NeedsFit { .. }) => "`mapper map fit FILE --out NEW`",
        E::History(HistoryError::Missing(_)) => "`mapper nightly`, or `--db FILE`",
        E::History(HistoryError::Foreign { .. } | HistoryError::ReadOnly(_)) => "`--db FILE`",
        _ => return None,
    };
    Some(fixed.to_owned())
}

/// As [`command_for`], for an error of a fleet directory.
pub fn fleet_command_for(error: &FleetError) -> Option<String> {
    Some(match error {
        FleetError::NoStudy(_) | FleetError::Changed(_) => {
            "`mapper fleet make STUDY.yaml --out DIR`".to_owned()
        }
        FleetError::NoItem(_) => "`mapper fleet status DIR --items`".to_owned(),
        FleetError::NothingLeft { directory, .. } => format!("`mapper fleet merge {}`", directory.display()),
        FleetError::NotSubmitted(_) => "`mapper fleet submit`".to_owned(),
        FleetError::StillQueued { .. } => "`mapper fleet retry`".to_owned(),
        _ => return None,
    })
}

fn acknowledge_command(rig: &str) -> String {
    let plain = !rig.is_empty() && rig.chars().all(|c| c.is_alphanumeric() || "-_./:@".contains(c));
    let quoted = if plain { rig.to_owned() } else { format!("'{}'", rig.replace('\'', r"'\''")) };
    format!("`mapper rig acknowledge {quoted}`")
}
