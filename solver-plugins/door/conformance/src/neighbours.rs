//! Whether a lane's bits depend on the lanes beside it.

use crate::run::Seen;
use crate::shapes::pick;

/// Lanes of the set from which batches are picked.
pub(crate) const ALL: usize = 64;
/// Sizes of what happens to a lane, one after the other from lane to lane: much, little, next to nothing. A short way that a
/// kernel takes when all lanes are small shows when lanes of one size come among those of another.
pub(crate) const SIZES: usize = 3;
/// Lanes of the smallest batch.
const FEW: usize = 8;
/// Lanes that are tried at every place among neighbours of every size.
const TRIED: usize = 12;

/// Rows of [`ALL`] values, of which every lane takes those of its size.
pub(crate) fn mixed(by_size: &[Vec<f64>; SIZES]) -> Vec<f64> {
    (0..by_size[0].len())
        .map(|i| by_size[i % ALL % SIZES][i])
        .collect()
}

/// The rows of the lanes `order`.
pub(crate) fn of_lanes(rows: &[f64], order: &[usize]) -> Vec<f64> {
    pick(rows, ALL, order)
}

/// Holds each lane against itself in other batches: `bits` gives all bits of a batch of these lanes of the set, by lane.
pub(crate) fn judge(bits: impl Fn(&[usize]) -> Vec<Vec<u64>>) -> Seen {
    let whole = bits(&(0..ALL).collect::<Vec<_>>());
    let differs = |order: &[usize]| {
        let part = bits(order);
        (0..order.len()).find(|to| part[*to] != whole[order[*to]])
    };
    for width in (FEW..=ALL).step_by(FEW) {
        for start in [0usize, 29] {
            // Backwards, from somewhere in the middle, and with the last lane repeated as in a tail.
            let mut order: Vec<usize> = (0..width).map(|i| (start + ALL - i) % ALL).collect();
            order[width - 1] = order[width - 2];
            if let Some(to) = differs(&order) {
                return Seen::Bad(format!(
                    "lane {} of {ALL} differs from the same in lane {to} of {width}",
                    order[to]
                ));
            }
        }
    }
    if let Some(lane) = (0..ALL).find(|lane| differs(&[*lane; FEW]).is_some()) {
        return Seen::Bad(format!(
            "lane {lane} of {ALL} differs from the same in a batch of nothing else"
        ));
    }
    for lane in 0..TRIED {
        for (size, what) in ["much", "little", "next to nothing"].iter().enumerate() {
            for place in 0..FEW {
                let others = (0..ALL).filter(|l| l % SIZES == size && *l != lane);
                let mut order: Vec<usize> = others.take(FEW).collect();
                order[place] = lane;
                if let Some(to) = differs(&order) {
                    return Seen::Bad(format!(
                        "lane {} of {ALL} differs from the same in lane {to} of {FEW}, where {what} happens to the others of the \
                         batch",
                        order[to]
                    ));
                }
            }
        }
    }
    Seen::Well(
        "same bits in batches of 8, 16, .. 64 lanes in other orders, alone, and at every place among lanes to which much, little \
         and next to nothing happens"
            .into(),
    )
}
