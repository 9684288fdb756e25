//! Gap diagnosis without steps: which cause explains the judged channels of a side driven by its measured neighbours.

mod denoise;
mod detectable;
mod diagnose;
mod fit;
mod held_out;
mod phases;
mod search;
mod side_diagnosis;
mod sides;

pub use diagnose::{SideRequest, diagnose};
pub use side_diagnosis::{
    Beyond, ChannelTrace, Diagnosis, HeldOut, NotDiagnosable, Phase, SideCause, SideVerdict, Unknown,
};
pub use sides::side::Side;
