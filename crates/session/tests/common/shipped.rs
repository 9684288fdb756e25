//! Campaigns made from the one that ships.

use mapper_campaign::Campaign;
use std::path::Path;

/// The shipped turbo_a with other lines put in for its own, each found once.
pub fn campaign(replacements: &[(&str, &str)]) -> Campaign {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns/turbo_a.yaml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (old, new) in replacements {
        assert_eq!(text.matches(old).count(), 1, "{old}");
        text = text.replace(old, new);
    }
    let none = |_: &Path| Err(std::io::ErrorKind::NotFound.into());
    mapper_campaign::check(&text, &path, &none).unwrap_or_else(|findings| panic!("{findings}"))
}
