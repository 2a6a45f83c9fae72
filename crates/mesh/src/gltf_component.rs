//! Numbers of a glTF file.

/// The component types, numbered from 5120 in glTF.
#[derive(Clone, Copy)]
pub(crate) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    pub(crate) fn of(code: u64) -> Option<Self> {
        Some(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return None,
        })
    }

    /// Like [`Component::of`], with an error for an unknown code.
    pub(crate) fn checked(code: u64) -> Result<Self, String> {
        Self::of(code).ok_or_else(|| format!("{code} is not a component type of glTF"))
    }

    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    pub(crate) fn can_index(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32)
    }

    /// The value of `bytes`, whose number is that of the type; exact for every value of every type.
    pub(crate) fn value(self, bytes: &[u8], normalized: bool) -> f64 {
        let mut low = [0; 4];
        low[..bytes.len()].copy_from_slice(bytes);
        let [a, b, ..] = low;
        let (value, most): (f64, f64) = match self {
            Self::I8 => (i8::from_le_bytes([a]).into(), i8::MAX.into()),
            Self::U8 => (a.into(), u8::MAX.into()),
            Self::I16 => (i16::from_le_bytes([a, b]).into(), i16::MAX.into()),
            Self::U16 => (u16::from_le_bytes([a, b]).into(), u16::MAX.into()),
            Self::U32 => (u32::from_le_bytes(low).into(), 1.0),
            Self::F32 => (f32::from_le_bytes(low).into(), 1.0),
        };
        if normalized { (value / most).max(-1.0) } else { value }
    }
}
