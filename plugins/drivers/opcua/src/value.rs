//! Numbers in OPC UA values.

use mapper_core::Quality;
use opcua::types::{DataValue, StatusCode, StatusCodeLimit, Variant, VariantTypeId};

/// The number in a value; NaN if it is not a number. A Boolean is 1 or 0.
pub(crate) fn number(value: &Variant) -> f64 {
    match value {
        Variant::Boolean(value) => f64::from(u8::from(*value)),
        Variant::SByte(value) => f64::from(*value),
        Variant::Byte(value) => f64::from(*value),
        Variant::Int16(value) => f64::from(*value),
        Variant::UInt16(value) => f64::from(*value),
        Variant::Int32(value) => f64::from(*value),
        Variant::UInt32(value) => f64::from(*value),
        Variant::Int64(value) => *value as f64,
        Variant::UInt64(value) => *value as f64,
        Variant::Float(value) => f64::from(*value),
        Variant::Double(value) => *value,
        _ => f64::NAN,
    }
}

/// The specification's name of a value's type.
pub(crate) fn type_name(value: &Variant) -> String {
    match value.type_id() {
        VariantTypeId::Empty => "empty".to_owned(),
        VariantTypeId::Scalar(scalar) => format!("{scalar:?}"),
        VariantTypeId::Array(scalar, _) => format!("array of {scalar:?}"),
    }
}

/// Whether the type is numeric, which excludes Boolean.
pub(crate) fn is_number(value: &Variant) -> bool {
    !matches!(value, Variant::Boolean(_))
        && (matches!(value, Variant::Float(_) | Variant::Double(_)) || !number(value).is_nan())
}

/// Whether the type is an integer type.
pub(crate) fn is_whole(value: &Variant) -> bool {
    !matches!(value, Variant::Float(_) | Variant::Double(_))
}

/// The number as a value of the same type as `variant`; `None` if it does not fit.
pub(crate) fn same_type(variant: &Variant, number: f64) -> Option<Variant> {
    let rounded = number.round();
    let within = |low: f64, high: f64| (low..=high).contains(&rounded).then_some(rounded);
    // Each cast is of a whole number within the range of its type.
    Some(match variant {
        Variant::Boolean(_) => Variant::Boolean(within(0.0, 1.0)? == 1.0),
        Variant::SByte(_) => Variant::SByte(within(f64::from(i8::MIN), f64::from(i8::MAX))? as i8),
        Variant::Byte(_) => Variant::Byte(within(0.0, f64::from(u8::MAX))? as u8),
        Variant::Int16(_) => Variant::Int16(within(f64::from(i16::MIN), f64::from(i16::MAX))? as i16),
        Variant::UInt16(_) => Variant::UInt16(within(0.0, f64::from(u16::MAX))? as u16),
        Variant::Int32(_) => Variant::Int32(within(f64::from(i32::MIN), f64::from(i32::MAX))? as i32),
        Variant::UInt32(_) => Variant::UInt32(within(0.0, f64::from(u32::MAX))? as u32),
        // Beyond 2^53 a double cannot represent every integer.
        Variant::Int64(_) => Variant::Int64(within(-9.0e15, 9.0e15)? as i64),
        Variant::UInt64(_) => Variant::UInt64(within(0.0, 9.0e15)? as u64),
        Variant::Float(_) if (number as f32).is_finite() => Variant::Float(number as f32),
        Variant::Double(_) if number.is_finite() => Variant::Double(number),
        _ => return None,
    })
}

/// The code without its additional bits (Part 4 of the specification, 7.39).
fn code(status: StatusCode) -> u32 {
    status.bits() & 0xFFFF_0000
}

/// Codes whose quality differs from that of their severity (Part 4, 7.39; Part 8, 6.3). A value that the sensor does not measure now,
/// because it was entered by hand, simulated, or kept from before, would blind the guards, so it is not a reading.
const STATUSES: [(StatusCode, Quality); 10] = [
    (StatusCode::Good, Quality::Good),
    // Sampling has slowed down.
    (StatusCode::GoodOverload, Quality::Good),
    (StatusCode::GoodCommunicationEvent, Quality::Good),
    (StatusCode::GoodLocalOverride, Quality::Bad),
    (StatusCode::GoodEdited, Quality::Bad),
    (StatusCode::UncertainInitialValue, Quality::Bad),
    (StatusCode::UncertainLastUsableValue, Quality::Bad),
    (StatusCode::UncertainNoCommunicationLastUsableValue, Quality::Bad),
    (StatusCode::UncertainSimulatedValue, Quality::Bad),
    (StatusCode::UncertainSubstituteValue, Quality::Bad),
];

/// Quality of a value, from its status: an absent status means good. Any other code of severity Good, such as `GoodClamped`, limits
/// what the number means; so does a value at a limit of its sensor. A value that cannot vary, or whose unit or type has changed, is not a reading.
pub(crate) fn quality(value: &DataValue) -> Quality {
    let Some(status) = value.status else { return Quality::Good };
    let limit = status.limit();
    if status.structure_changed() || status.semantics_changed() || limit == StatusCodeLimit::Constant {
        return Quality::Bad;
    }
    match STATUSES.iter().find(|(listed, _)| code(*listed) == code(status)) {
        Some((_, Quality::Good)) if limit != StatusCodeLimit::None => Quality::Uncertain,
        Some((_, quality)) => *quality,
        None if status.is_good() || status.is_uncertain() => Quality::Uncertain,
        None => Quality::Bad,
    }
}

/// Whether a value was written exactly: only `Good` confirms that. `GoodClamped` means that another value was written, and
/// `GoodCompletesAsynchronously` that the result is still open.
pub(crate) fn is_written(status: StatusCode) -> bool {
    status == StatusCode::Good
}

/// A status with its code, for look-up: `BadOutOfRange (0x803C0000)`.
pub(crate) fn describe_status(status: StatusCode) -> String {
    format!("{status} (0x{:08X})", status.bits())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Round trip of each type; a value that does not fit is not written.
    #[test]
    fn numbers_keep_the_type_of_the_node() {
        for variant in [
            Variant::SByte(0),
            Variant::Byte(0),
            Variant::Int16(0),
            Variant::UInt16(0),
            Variant::Int32(0),
            Variant::UInt32(0),
            Variant::Int64(0),
            Variant::UInt64(0),
            Variant::Float(0.0),
            Variant::Double(0.0),
        ] {
            let value = same_type(&variant, 101.0).unwrap();
            assert_eq!(value.type_id(), variant.type_id());
            assert_eq!(number(&value), 101.0);
            assert_eq!(same_type(&variant, f64::NAN), None, "{variant:?}");
        }
        assert_eq!(same_type(&Variant::Boolean(false), 1.0), Some(Variant::Boolean(true)));
        assert_eq!(same_type(&Variant::Boolean(false), 2.0), None);
        assert_eq!(same_type(&Variant::UInt16(0), 65_536.0), None);
        assert_eq!(same_type(&Variant::Byte(0), -1.0), None);
        assert_eq!(same_type(&Variant::Float(0.0), 1e300), None);
        assert_eq!(same_type(&Variant::Empty, 1.0), None);
        assert!(number(&Variant::from("101")).is_nan());
    }

    #[test]
    fn each_status_has_its_quality() {
        let with = |status| quality(&DataValue { status, ..DataValue::null() });
        assert_eq!(with(None), Quality::Good);
        assert_eq!(with(Some(StatusCode::GoodClamped)), Quality::Uncertain);
        assert_eq!(with(Some(StatusCode::GoodNoData)), Quality::Uncertain);
        assert_eq!(with(Some(StatusCode::GoodOverload)), Quality::Good);
        assert_eq!(with(Some(StatusCode::UncertainSensorNotAccurate)), Quality::Uncertain);
        // Nothing measures them.
        for status in [StatusCode::GoodLocalOverride, StatusCode::UncertainLastUsableValue] {
            assert_eq!(with(Some(status)), Quality::Bad, "{status}");
        }
        // Additional bits change nothing.
        let clipped = StatusCode::from(StatusCode::UncertainSubstituteValue.bits() | 0x0500);
        assert_eq!(with(Some(clipped)), Quality::Bad);
        assert_eq!(with(Some(StatusCode::BadSensorFailure)), Quality::Bad);
        assert!(is_written(StatusCode::Good));
        let others = [
            StatusCode::GoodClamped,
            StatusCode::GoodCompletesAsynchronously,
            StatusCode::GoodOverload,
            StatusCode::UncertainLastUsableValue,
            StatusCode::BadOutOfRange,
        ];
        assert!(!others.into_iter().any(is_written));
    }
}
