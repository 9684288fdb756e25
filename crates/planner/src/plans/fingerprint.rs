//! Hashes of the inputs of a plan, so that a run can detect a changed campaign or model.

use crate::request::PlanRequest;
use mapper_core::PlanInputHashes;
use sha2::{Digest, Sha256};
use std::fmt::Write;

/// SHA-256 of a text, as 64 hexadecimal digits.
pub fn sha256_hex(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().fold(String::with_capacity(64), |mut hex, byte| {
        // Writing to a String cannot fail.
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

/// Hashes the campaign and the nominal machine of `request`.
pub fn hash_inputs(request: &PlanRequest<'_>) -> PlanInputHashes {
    // `Debug` prints every parameter with all digits.
    let model = format!("{:?} {}", request.model.params, request.model.map.fingerprint());
    PlanInputHashes {
        campaign_sha256: sha256_hex(request.campaign_canonical),
        model_sha256: sha256_hex(&model),
        script_sha256: None,
        rig_sha256: None,
    }
}

#[cfg(test)]
mod tests {
    /// FIPS 180-2, appendix B.1.
    #[test]
    fn hashes_the_standards_example() {
        let expected = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(super::sha256_hex("abc"), expected);
    }
}
