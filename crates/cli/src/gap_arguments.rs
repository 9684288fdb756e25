//! The command line of `mapper gap`.

use clap::{Args, Subcommand, ValueEnum};
use std::path::PathBuf;

/// `mapper gap`.
#[derive(Debug, Args)]
pub struct GapArguments {
    /// What to do.
    #[command(subcommand)]
    pub command: GapCommand,
}

/// One variant a command.
#[derive(Debug, Subcommand)]
pub enum GapCommand {
    /// Say where a recording leaves the nominal model, which effect causes it, how far that closes the gap, what is next
    Diagnose(DiagnoseArguments),
    /// Check the diagnosis on data whose causes are withheld
    Blind(BlindArguments),
    /// List the effects that a rig may have and the nominal model has not
    Effects(EffectsArguments),
}

/// `mapper gap diagnose`.
#[derive(Debug, Args)]
pub struct DiagnoseArguments {
    /// Campaign that says machine, declared uncertainties and tolerances (YAML)
    pub campaign: PathBuf,
    /// Run directory, or MCAP file
    #[arg(long, value_name = "FILE")]
    pub recording: PathBuf,
    /// Where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "MAP")]
    pub channels: Option<PathBuf>,
    /// Also try a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    /// Also write a page with pictures to this new file
    #[arg(long, value_name = "OUT")]
    pub html: Option<PathBuf>,
}

/// `mapper gap effects`.
#[derive(Debug, Args)]
pub struct EffectsArguments {
    /// Also check and list a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper gap blind`.
#[derive(Debug, Args)]
pub struct BlindArguments {
    /// What to do.
    #[command(subcommand)]
    pub command: BlindCommand,
}

/// One variant a command.
#[derive(Debug, Subcommand)]
pub enum BlindCommand {
    /// Draw cases on the virtual lab, record them, seal their causes and print the seal
    Make(BlindMakeArguments),
    /// Diagnose the recordings that have no diagnosis yet
    Run(BlindRunArguments),
    /// Open the seal and print how often the diagnoses are right
    Score(BlindScoreArguments),
    /// Find the numbers behind the probabilities on cases of its own, with outside causes that the check does not use
    Calibrate(BlindCalibrateArguments),
}

/// `mapper gap blind make`.
#[derive(Debug, Args)]
pub struct BlindMakeArguments {
    /// Campaign that says machine, schedule, declared uncertainties and tolerances (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
    /// Directory for the cases
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Seed of everything that is drawn
    #[arg(long)]
    pub seed: u64,
    /// Number of cases
    #[arg(long)]
    pub cases: usize,
    /// Draw cases of this kind alone; may be repeated
    #[arg(long = "kind", value_name = "KIND")]
    pub kinds: Vec<BlindKind>,
    /// Shortest signature of a cause, in sigmas
    #[arg(long, value_name = "SIGMAS", default_value_t = mapper_blind::SIGMA_RANGE[0])]
    pub least_sigma: f64,
    /// Longest signature of a cause, in sigmas
    #[arg(long, value_name = "SIGMAS", default_value_t = mapper_blind::SIGMA_RANGE[1])]
    pub most_sigma: f64,
    /// Draw outside causes from those kept for calibration, not from those reserved for the check
    #[arg(long)]
    pub calibration: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// What a blind case is a case of.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum BlindKind {
    /// Nothing beyond the declared tolerances.
    None,
    /// One effect of the catalogue.
    Single,
    /// Two effects of the catalogue.
    Pair,
    /// A cause outside the catalogue.
    Outside,
}

/// `mapper gap blind run`.
#[derive(Debug, Args)]
pub struct BlindRunArguments {
    /// Directory of the cases
    pub directory: PathBuf,
    /// Campaign that the diagnosis is told (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
}

/// `mapper gap blind score`.
#[derive(Debug, Args)]
pub struct BlindScoreArguments {
    /// Directory of the cases
    pub directory: PathBuf,
    /// Also write each answer as NAME.truth.json beside its recording
    #[arg(long)]
    pub open: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper gap blind calibrate`.
#[derive(Debug, Args)]
pub struct BlindCalibrateArguments {
    /// Campaign that says machine, schedule, declared uncertainties and tolerances (YAML)
    #[arg(long, value_name = "FILE", default_value = "campaigns/gap_rig.yaml")]
    pub campaign: PathBuf,
    /// Seed of everything that is drawn
    #[arg(long)]
    pub seed: u64,
    /// Number of cases without a cause, which set the threshold
    #[arg(long)]
    pub nulls: usize,
    /// Number of cases of the other kinds
    #[arg(long)]
    pub cases: usize,
    /// New file for the calibration (JSON)
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Also write what each case gave to this new file (JSON)
    #[arg(long, value_name = "FILE")]
    pub observed: Option<PathBuf>,
}
