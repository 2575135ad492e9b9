//! Serde adapters: how positions and missing numbers are written.

/// Serde adapter for positions of images, which are written as people count them, from 1.
pub(crate) mod positions_from_one {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(positions: &Option<Vec<usize>>, out: S) -> Result<S::Ok, S::Error> {
        let written = positions.as_ref().map(|all| all.iter().map(|position| position + 1).collect::<Vec<usize>>());
        written.serialize(out)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<Option<Vec<usize>>, D::Error> {
        let read = Option::<Vec<usize>>::deserialize(input)?;
        let positions = read.map(|all| all.into_iter().map(reconstruct::index_of_position).collect());
        positions.transpose().map_err(D::Error::custom)
    }
}

/// Serde adapter for a number that may be NaN, which JSON writes as `null`.
pub(crate) mod null_is_nan {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(value: &f64, out: S) -> Result<S::Ok, S::Error> {
        value.serialize(out)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(input)?.unwrap_or(f64::NAN))
    }
}
