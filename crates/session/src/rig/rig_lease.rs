//! Exclusive locks on the rig and auxiliary instruments of a run.

use crate::SessionError;
use crate::rig::rig_state::{Claim, Lockout, Owner, RigStates};
use std::path::Path;

/// The locks of a run.
#[derive(Default)]
pub(crate) struct RigLease {
    /// The rig, if it can have only one user.
    rig: Option<Claim>,
    /// Auxiliary instruments and the rig's address, one lock each. They have no recorded owner: only the rig itself needs an acknowledgement
    /// after an abandoned run.
    instruments: Vec<Claim>,
}

impl RigLease {
    /// Locks the rig and the instruments by name. `resumes`: the run to resume.
    pub(crate) fn acquire(
        states: &RigStates,
        rig: Option<&str>,
        instruments: &[String],
        resumes: Option<&Path>,
    ) -> Result<Self, SessionError> {
        let rig = rig.map(|name| states.claim(name, resumes)).transpose()?;
        let instruments =
            instruments.iter().map(|name| states.claim(name, resumes)).collect::<Result<_, _>>()?;
        Ok(RigLease { rig, instruments })
    }

    /// Records the owner of the rig.
    pub(crate) fn record_owner(&mut self, run: &Path, started: &str) -> Result<(), SessionError> {
        self.rig.as_mut().map_or(Ok(()), |claim| claim.record_owner(&owner(run, started)))
    }

    /// Releases all locks. With a reason for a lockout, the rig is locked out until an operator acknowledges it.
    pub(crate) fn release(self, lockout: Option<String>, run: &Path) -> Result<(), SessionError> {
        for instrument in self.instruments {
            instrument.release()?;
        }
        let Some(claim) = self.rig else { return Ok(()) };
        if let Some(reason) = lockout {
            claim.lock_out(&Lockout { reason, run: run.to_owned() })?;
        }
        claim.release()
    }
}

fn owner(run: &Path, started: &str) -> Owner {
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    Owner {
        process: std::process::id(),
        host: host.trim().to_owned(),
        run: std::path::absolute(run).unwrap_or_else(|_| run.to_owned()),
        started: started.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two campaigns may give one controller different names.
    #[test]
    fn one_controller_under_two_names_is_one_rig() {
        let directory = tempfile::tempdir().unwrap();
        let states = RigStates::new(directory.path());
        let place = ["at 10.0.0.3:502 unit 255".to_owned()];
        let first = RigLease::acquire(&states, Some("cell 3"), &place, None).unwrap();
        let refused = RigLease::acquire(&states, Some("cell three"), &place, None).map(drop).unwrap_err();
        assert!(matches!(refused, SessionError::RigInUse { .. }), "{refused}");
        assert!(
            RigLease::acquire(&states, Some("cell 4"), &["at 10.0.0.4:502 unit 255".to_owned()], None)
                .is_ok()
        );
        first.release(None, Path::new("runs/a")).unwrap();
        assert!(RigLease::acquire(&states, Some("cell three"), &place, None).is_ok());
    }
}
