//! Numbers of a glTF file.

use crate::number::Number;

/// The component type of a code, numbered from 5120 in glTF.
pub(crate) fn component(code: u64) -> Option<Number> {
    Some(match code {
        5120 => Number::I8,
        5121 => Number::U8,
        5122 => Number::I16,
        5123 => Number::U16,
        5125 => Number::U32,
        5126 => Number::F32,
        _ => return None,
    })
}

/// Like [`component`], with an error for an unknown code.
pub(crate) fn checked_component(code: u64) -> Result<Number, String> {
    component(code).ok_or_else(|| format!("{code} is not a component type of glTF"))
}

pub(crate) fn can_index(component: Number) -> bool {
    matches!(component, Number::U8 | Number::U16 | Number::U32)
}

/// The value of `bytes`; if `normalized`, relative to the largest one of the type.
pub(crate) fn value_of(component: Number, bytes: &[u8], normalized: bool) -> f64 {
    let value = component.of_le(bytes);
    let most: f64 = match component {
        Number::I8 => i8::MAX.into(),
        Number::U8 => u8::MAX.into(),
        Number::I16 => i16::MAX.into(),
        Number::U16 => u16::MAX.into(),
        _ => return value,
    };
    if normalized { (value / most).max(-1.0) } else { value }
}
