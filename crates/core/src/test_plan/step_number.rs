//! The number of a step: files and texts count from 1, code uses an index from 0.
//!
//! The serde adapters write the number and read it back as an index: this module for one step or several; [`entry`] for
//! plans and step markers, whose older files have the index.

use serde::de::{Deserialize, DeserializeOwned, Deserializer, Error};
use serde::ser::{Serialize, Serializer};

/// The number of the step at an index, from 1.
pub fn step_number(index: usize) -> usize {
    index.saturating_add(1)
}

fn index_of<E: Error>(number: usize) -> Result<usize, E> {
    number.checked_sub(1).ok_or_else(|| E::custom("steps count from 1, and this one has the number 0"))
}

/// Indices of steps, which files have as numbers.
pub trait Steps: Sized {
    /// Their numbers, in the same form.
    type Numbers: Serialize + DeserializeOwned;

    /// Their numbers.
    fn numbers(&self) -> Self::Numbers;

    /// Their indices.
    fn indices<E: Error>(numbers: Self::Numbers) -> Result<Self, E>;
}

impl Steps for usize {
    type Numbers = usize;

    fn numbers(&self) -> usize {
        step_number(*self)
    }

    fn indices<E: Error>(number: usize) -> Result<usize, E> {
        index_of(number)
    }
}

impl<T: Steps> Steps for Option<T> {
    type Numbers = Option<T::Numbers>;

    fn numbers(&self) -> Self::Numbers {
        self.as_ref().map(T::numbers)
    }

    fn indices<E: Error>(numbers: Self::Numbers) -> Result<Self, E> {
        numbers.map(T::indices).transpose()
    }
}

impl<T: Steps> Steps for Vec<T> {
    type Numbers = Vec<T::Numbers>;

    fn numbers(&self) -> Self::Numbers {
        self.iter().map(T::numbers).collect()
    }

    fn indices<E: Error>(numbers: Self::Numbers) -> Result<Self, E> {
        numbers.into_iter().map(T::indices).collect()
    }
}

/// Writes the numbers of steps.
pub fn serialize<S: Serializer>(indices: &impl Steps, serializer: S) -> Result<S::Ok, S::Error> {
    indices.numbers().serialize(serializer)
}

/// Reads numbers from 1 as indices.
pub fn deserialize<'de, T: Steps, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::indices(T::Numbers::deserialize(deserializer)?)
}

/// For a flattened field: `step` from 1. Files of version 0.1.0 have `index` from 0 instead.
pub mod entry {
    use super::{Deserialize, Deserializer, Error, Serialize, Serializer, index_of};
    use crate::step_number;

    #[derive(serde::Serialize)]
    struct StepField {
        step: usize,
    }

    #[derive(serde::Deserialize)]
    struct StepOrIndex {
        step: Option<usize>,
        index: Option<usize>,
    }

    /// Writes `step`.
    pub fn serialize<S: Serializer>(index: &usize, serializer: S) -> Result<S::Ok, S::Error> {
        StepField { step: step_number(*index) }.serialize(serializer)
    }

    /// Reads `step` or `index`.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<usize, D::Error> {
        let StepOrIndex { step, index } = StepOrIndex::deserialize(deserializer)?;
        match step {
            Some(step) => index_of(step),
            None => index.ok_or_else(|| D::Error::missing_field("step")),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Marked {
        #[serde(flatten, with = "super::entry")]
        index: usize,
        at: f64,
    }

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Named {
        #[serde(with = "super")]
        step: usize,
    }

    #[test]
    fn files_count_from_one_and_those_of_0_1_0_still_read() {
        for index in [0, 1, 57, 999_999] {
            let text = serde_json::to_string(&Marked { index, at: 0.1 }).unwrap();
            assert!(text.contains(&format!("\"step\":{}", index + 1)) && !text.contains("index"), "{text}");
            let old = format!("{{\"at\":0.1,\"index\":{index}}}");
            for text in [text, old] {
                assert_eq!(serde_json::from_str::<Marked>(&text).unwrap(), Marked { index, at: 0.1 });
            }
            let text = serde_json::to_string(&Named { step: index }).unwrap();
            assert_eq!(serde_json::from_str::<Named>(&text).unwrap(), Named { step: index });
        }
    }

    #[test]
    fn what_is_no_number_of_a_step_is_refused() {
        for (text, words) in [
            ("{\"step\":0,\"at\":0}", "count from 1"),
            ("{\"at\":0}", "missing field `step`"),
            ("{\"step\":-1,\"at\":0}", "integer"),
            ("{\"step\":1.5,\"at\":0}", "floating"),
        ] {
            let error = serde_json::from_str::<Marked>(text).unwrap_err().to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
        assert!(serde_json::from_str::<Named>("{\"step\":0}").is_err());
    }
}
