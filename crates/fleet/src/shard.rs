//! A share of the items, determined by their hash alone, so that added or removed items do not change it.

use crate::Hash;
use std::fmt;
use std::str::FromStr;

/// Share `number` of `of`, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: u64,
    of: u64,
}

impl Shard {
    /// The share of an item.
    pub fn holding(hash: &Hash, of: u64) -> Shard {
        Shard { number: hash.number() % of.max(1) + 1, of: of.max(1) }
    }

    /// Number of the share, from 1.
    pub fn number(self) -> u64 {
        self.number
    }

    /// Whether it contains this item.
    pub fn holds(self, hash: &Hash) -> bool {
        Shard::holding(hash, self.of) == self
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let numbers = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        match numbers {
            Some((number, of)) if 1 <= number && number <= of => Ok(Shard { number, of }),
            _ => Err(format!("`{text}` is not a shard; write K/N with K from 1 to N, e.g. 3/8")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_item_is_in_one_shard_and_shards_are_even() {
        let hashes: Vec<Hash> = (0..8000u32).map(|i| Hash::of(&i.to_le_bytes())).collect();
        let shards: Vec<Shard> = (1..=8).map(|k| format!("{k}/8").parse().unwrap()).collect();
        for hash in &hashes {
            assert_eq!(shards.iter().filter(|shard| shard.holds(hash)).count(), 1);
        }
        for shard in shards {
            // A thousand each, with a standard deviation of 30.
            let held = hashes.iter().filter(|hash| shard.holds(hash)).count();
            assert!((850..1150).contains(&held), "{shard}: {held}");
        }
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0", "-1/2"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
