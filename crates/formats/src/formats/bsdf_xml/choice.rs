//! Choice of the functions that are read, by quantity, side of the light and band.

use super::super::error::{FormatError, FormatErrorKind};
use super::super::interpretation::Interpretation;
use super::super::lit_side::LitSide;
use super::about::NAME;
use super::blocks::{Block, kind};
use crate::domain::Quantity;

/// Upper bound on the number of names in one message; files of WINDOW hold eight functions. Raising it makes messages
/// of files with many bands longer.
const MOST_NAMED: usize = 24;

/// Functions that are read: of reflected light, of transmitted light, or of both.
#[derive(Debug)]
pub(super) struct Choice<'a> {
    pub(super) quantity: Quantity,
    pub(super) reflection: Option<&'a Block<'a>>,
    pub(super) transmission: Option<&'a Block<'a>>,
}

impl<'a> Choice<'a> {
    /// Returns the functions that are read, that of reflected light first.
    pub(super) fn blocks(&self) -> impl Iterator<Item = &'a Block<'a>> {
        self.reflection.into_iter().chain(self.transmission)
    }

    pub(super) fn side(&self) -> LitSide {
        self.blocks().next().map_or(LitSide::Front, |block| block.side)
    }

    /// Returns a description of the functions that are read: `Visible, reflection and transmission, light from front`.
    pub(super) fn describe(&self) -> String {
        let band = self.blocks().next().map_or("", |block| &block.band);
        let kinds: Vec<&str> = self.blocks().map(|block| kind(block.transmits)).collect();
        format!("{band}, {}, light from {}", kinds.join(" and "), self.side())
    }

    /// Returns descriptions of the functions of the file that are not read, for people; `None` if all are read.
    pub(super) fn left_out(&self, blocks: &[Block<'_>]) -> Option<String> {
        let is_read = |block: &Block<'_>| self.blocks().any(|read| read.data.offset == block.data.offset);
        let others: Vec<String> = blocks.iter().filter(|block| !is_read(block)).map(Block::describe).collect();
        (!others.is_empty()).then(|| joined(&others, ", "))
    }
}

/// Chooses the functions of a file that the user asks for; asks for an option if several are left.
pub(super) fn choose<'a>(blocks: &'a [Block<'a>], how: &Interpretation) -> Result<Choice<'a>, FormatError> {
    let held = || joined(&blocks.iter().map(Block::describe).collect::<Vec<_>>(), ", ");
    let needs = |message: String| {
        let message = format!("{message}; the BSDF file holds {}", held());
        FormatError::new(FormatErrorKind::NeedsOption, NAME, message)
    };
    let kinds: &[bool] = match how.quantity() {
        None | Some(Quantity::Bsdf) => &[false, true],
        Some(Quantity::Brdf) => &[false],
        Some(Quantity::Btdf) => &[true],
        Some(other) => return Err(needs(format!("quantity {other} was asked for, expected brdf, btdf or bsdf"))),
    };
    let is_band =
        |block: &Block<'_>| how.band.as_ref().is_none_or(|band| band.trim().eq_ignore_ascii_case(&block.band));
    let is_side = |block: &Block<'_>| how.side.is_none_or(|side| side == block.side);
    let left: Vec<&Block<'_>> =
        blocks.iter().filter(|block| kinds.contains(&block.transmits) && is_band(block) && is_side(block)).collect();
    let asked = |what: &str| {
        let options = [("band", how.band.clone()), ("side", how.side.map(|side| side.to_string()))];
        let options = options.into_iter().filter_map(|(name, value)| Some(format!("{name} {}", value?)));
        let quantity = how.quantity().map(|quantity| format!("quantity {quantity}"));
        let asked: Vec<String> = quantity.into_iter().chain(options).collect();
        needs(format!("no function of {}, expected {what}", asked.join(", ")))
    };
    let mut open = Vec::new();
    let bands = distinct(left.iter().map(|block| block.band.as_str()));
    if bands.len() > 1 {
        open.push(format!("option band ({})", joined(&bands, " or ")));
    }
    let sides = distinct(left.iter().map(|block| block.side.name()));
    if sides.len() > 1 {
        open.push(format!("option side, that of the light ({})", joined(&sides, " or ")));
    }
    if !open.is_empty() {
        let message = format!("several functions are meant, expected one: give the {}", open.join(" and the "));
        return Err(needs(message));
    }
    let of_kind = |transmits: bool| left.iter().copied().find(|block| block.transmits == transmits);
    let (reflection, transmission) = (of_kind(false), of_kind(true));
    let quantity = match (how.quantity(), reflection, transmission) {
        (_, None, None) => return Err(asked("one that the file holds")),
        (Some(Quantity::Bsdf), None, _) | (Some(Quantity::Bsdf), _, None) => {
            return Err(asked("reflection and transmission of one band and side"));
        }
        (_, Some(_), Some(_)) => Quantity::Bsdf,
        (_, Some(_), None) => Quantity::Brdf,
        (_, None, Some(_)) => Quantity::Btdf,
    };
    Ok(Choice { quantity, reflection, transmission })
}

/// Joins names for a message; of many, the first.
fn joined<T: AsRef<str>>(names: &[T], by: &str) -> String {
    let named = names.iter().take(MOST_NAMED).map(AsRef::as_ref).collect::<Vec<_>>().join(by);
    if names.len() > MOST_NAMED { format!("{named} and {} more", names.len() - MOST_NAMED) } else { named }
}

/// Returns the names without repetitions, in their order.
fn distinct<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    names.fold(Vec::new(), |mut kept, name| {
        if !kept.iter().any(|known: &&str| known.eq_ignore_ascii_case(name)) {
            kept.push(name);
        }
        kept
    })
}
