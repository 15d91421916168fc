//! Writes what changes during a run to bytes and reads it back, bit for bit.
//!
//! One and the same function of a type does both (`fn archive(&mut self, to: &mut Archive)`), so that the order of what
//! is written cannot differ from that of what is read. There are no names and no versions in the bytes: whoever keeps them
//! makes sure that the same program, parameters and inputs read them.

use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io::Write;

/// Where values go, or where they come from.
pub enum Archive<'a> {
    /// Values are written.
    Save(&'a mut dyn Write),
    /// Values are read; what is left of the bytes.
    Load(&'a [u8]),
}

/// Why bytes cannot be written or read.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The bytes could not be written.
    #[error("writing the state: {0}")]
    Write(String),
    /// The bytes are not those of this model.
    #[error("the state does not fit the model: {0}")]
    Misfit(String),
}

impl Archive<'_> {
    /// Any value.
    ///
    /// # Errors
    /// When the bytes cannot be written, or are not those of such a value.
    pub fn value<T: Serialize + DeserializeOwned>(
        &mut self,
        value: &mut T,
    ) -> Result<(), ArchiveError> {
        match self {
            Self::Save(to) => {
                let done = postcard::to_io(value, to);
                done.map_err(|e| ArchiveError::Write(e.to_string()))?;
            }
            Self::Load(from) => {
                let (found, rest) = postcard::take_from_bytes(from)
                    .map_err(|e| ArchiveError::Misfit(e.to_string()))?;
                (*value, *from) = (found, rest);
            }
        }
        Ok(())
    }

    /// Values whose number does not change.
    ///
    /// # Errors
    /// As [`Archive::value`]; when there is another number of them.
    pub fn values<T: Serialize + DeserializeOwned>(
        &mut self,
        values: &mut [T],
    ) -> Result<(), ArchiveError> {
        self.count(values.len())?;
        values.iter_mut().try_for_each(|v| self.value(v))
    }

    /// Numbers whose number does not change.
    ///
    /// # Errors
    /// As [`Archive::values`].
    pub fn numbers(&mut self, values: &mut [f64]) -> Result<(), ArchiveError> {
        self.count(values.len())?;
        match self {
            Self::Save(to) => {
                for v in values {
                    let done = to.write_all(&v.to_le_bytes());
                    done.map_err(|e| ArchiveError::Write(e.to_string()))?;
                }
            }
            Self::Load(from) => {
                let short = || ArchiveError::Misfit("it ends too early".into());
                let (own, rest) = from.split_at_checked(8 * values.len()).ok_or_else(short)?;
                for (v, bytes) in values.iter_mut().zip(own.as_chunks().0) {
                    *v = f64::from_le_bytes(*bytes);
                }
                *from = rest;
            }
        }
        Ok(())
    }

    fn count(&mut self, expected: usize) -> Result<(), ArchiveError> {
        let mut found = expected;
        self.value(&mut found)?;
        if found != expected {
            let text = format!("{found} values where the model has {expected}");
            return Err(ArchiveError::Misfit(text));
        }
        Ok(())
    }

    /// Whether nothing is left to read; always so when saving.
    pub fn is_at_end(&self) -> bool {
        match self {
            Self::Save(_) => true,
            Self::Load(rest) => rest.is_empty(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_bit_for_bit_and_misfits_are_told() {
        let mut bytes = Vec::new();
        let mut save = Archive::Save(&mut bytes);
        let mut odd = [-0.0, f64::MIN_POSITIVE / 3.0, 0.1 + 0.2, 1e300];
        save.numbers(&mut odd).unwrap();
        save.value(&mut Some(7u32)).unwrap();
        save.values(&mut [[1.5, 2.5], [3.5, 4.5]]).unwrap();
        let (mut numbers, mut some, mut rows) = ([0.0; 4], None::<u32>, [[0.0; 2]; 2]);
        let mut load = Archive::Load(&bytes);
        load.numbers(&mut numbers).unwrap();
        load.value(&mut some).unwrap();
        assert!(!load.is_at_end());
        load.values(&mut rows).unwrap();
        assert!(load.is_at_end());
        assert_eq!(numbers.map(f64::to_bits), odd.map(f64::to_bits));
        assert_eq!((some, rows), (Some(7), [[1.5, 2.5], [3.5, 4.5]]));
        let misfit = Archive::Load(&bytes).numbers(&mut [0.0; 3]).unwrap_err();
        assert!(
            misfit
                .to_string()
                .contains("4 values where the model has 3")
        );
        let torn = Archive::Load(&bytes[..20])
            .numbers(&mut [0.0; 4])
            .unwrap_err();
        assert!(torn.to_string().contains("ends too early"));
    }
}
