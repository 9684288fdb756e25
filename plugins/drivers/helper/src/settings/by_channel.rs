//! Settings by channel, with error paths that contain the channel.

use mapper_core::Channel;
use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, MapAccess, Visitor};
use std::collections::BTreeMap;
use std::marker::PhantomData;

/// Reads a map from channels, for `#[serde(deserialize_with = "mapper_driver::by_channel")]`. Its keys are read as text: otherwise
/// `serde_path_to_error` would report an error at `read.?.node`.
///
/// # Errors
/// If a key is not a channel or is repeated, or if a value is invalid.
pub fn by_channel<'de, T, D>(from: D) -> Result<BTreeMap<Channel, T>, D::Error>
where
    T: Deserialize<'de>,
    D: Deserializer<'de>,
{
    struct Channels<T>(PhantomData<T>);

    /// A value at this key. An invalid key is reported at the key itself too.
    struct At<T>(String, PhantomData<T>);

    impl<'de, T: Deserialize<'de>> DeserializeSeed<'de> for At<T> {
        type Value = (Channel, T);

        fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<Self::Value, D::Error> {
            let channel = self.0.parse::<Channel>().map_err(D::Error::custom)?;
            Ok((channel, T::deserialize(from)?))
        }
    }

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Channels<T> {
        type Value = BTreeMap<Channel, T>;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("the place of each channel, by its symbol")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut found = BTreeMap::new();
            while let Some(symbol) = map.next_key::<String>()? {
                let (channel, value) = map.next_value_seed(At(symbol, PhantomData))?;
                if found.insert(channel, value).is_some() {
                    return Err(A::Error::custom(format!("the channel {channel} appears twice")));
                }
            }
            Ok(found)
        }
    }

    from.deserialize_map(Channels(PhantomData))
}
