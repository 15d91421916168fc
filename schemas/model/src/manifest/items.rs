//! What a list must be: how many items, and in which order.

use serde::{Deserialize, Serialize};

/// What a list must be besides what its items are.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Items {
    /// Fewest items.
    pub minimum: Option<u64>,
    /// Most items.
    pub maximum: Option<u64>,
    /// How numbers follow one another.
    pub order: Option<Order>,
}

/// How the numbers of a list follow one another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Order {
    /// Each is more than the one before.
    Increasing,
    /// None is less than the one before.
    NotFalling,
}

/// What of a list is not as its declaration asks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unfit {
    /// The item, from 0; `None`: their number.
    pub item: Option<usize>,
    /// What is expected.
    pub expected: String,
}

impl Items {
    /// What is expected of so many items, when there are too few or too many.
    pub fn broken_by_count(&self, count: usize) -> Option<String> {
        let count = count as u64;
        let within =
            self.minimum.is_none_or(|m| count >= m) && self.maximum.is_none_or(|m| count <= m);
        if within {
            return None;
        }
        Some(match (self.minimum, self.maximum) {
            (Some(a), Some(b)) if a == b => format!("{a} items"),
            (Some(a), Some(b)) => format!("{a} to {b} items"),
            (Some(a), None) => format!("at least {a} items"),
            (None, Some(b)) => format!("at most {b} items"),
            (None, None) => return None,
        })
    }

    /// The first of the numbers (SI) that does not follow the one before it as it must, and what is expected.
    pub fn broken_by_order(&self, numbers: &[f64]) -> Option<Unfit> {
        let order = self.order?;
        let breaks = |w: &[f64]| match order {
            Order::Increasing => w[1] <= w[0],
            Order::NotFalling => w[1] < w[0],
        };
        let item = numbers.windows(2).position(breaks)? + 1;
        let words = match order {
            Order::Increasing => "more than the item before it",
            Order::NotFalling => "no less than the item before it",
        };
        Some(Unfit {
            item: Some(item),
            expected: words.into(),
        })
    }

    pub(super) fn check(&self) -> Result<(), String> {
        match (self.minimum, self.maximum) {
            (Some(a), Some(b)) if a > b => {
                Err(format!("no list has at least {a} and at most {b} items"))
            }
            _ => Ok(()),
        }
    }
}
