//! What every call is made with and looked at for.

use crate::buffer::Guarded;
use plyflow_sdk::abi::*;
use std::ffi::c_void;

/// Time step of the calls that move (s); laws that do not depend on rates do not notice.
pub(crate) const DT: f64 = 1e-6;

/// What a call did that it may not do.
#[derive(Clone, Debug, Default)]
pub(crate) struct Breaches {
    /// Status other than PF_OK.
    pub(crate) status: Option<String>,
    /// Writes where nothing may be written.
    pub(crate) guards: Option<String>,
    /// Outputs that were not written.
    pub(crate) gaps: Option<String>,
    /// Outputs that are not finite.
    pub(crate) finite: Option<String>,
}

impl Breaches {
    pub(crate) fn add(&mut self, other: Self) {
        self.status = self.status.take().or(other.status);
        self.guards = self.guards.take().or(other.guards);
        self.gaps = self.gaps.take().or(other.gaps);
        self.finite = self.finite.take().or(other.finite);
    }

    /// Everything at once, for checks that are about something else.
    pub(crate) fn any(&self) -> Option<String> {
        let all = [&self.status, &self.guards, &self.gaps, &self.finite];
        all.into_iter().flatten().next().cloned()
    }

    pub(crate) fn status(&mut self, call: &str, code: i32) {
        let meaning = match code {
            PF_OK => return,
            PF_ERROR => "PF_ERROR",
            PF_CANCELLED => "PF_CANCELLED",
            PF_PANIC => "PF_PANIC: it panicked",
            PF_NOT_FOUND => "PF_NOT_FOUND",
            PF_BAD_SHAPE => "PF_BAD_SHAPE",
            PF_BAD_VALUE => "PF_BAD_VALUE",
            _ => "not a status of plyflow.h",
        };
        self.status
            .get_or_insert(format!("{call} returned {code} ({meaning})"));
    }

    /// A buffer after a call: its guard zones.
    pub(crate) fn zones(&mut self, call: &str, name: &str, b: &Guarded) {
        if let Some(at) = b.breach() {
            let len = b.slice().len() as isize;
            let place = if at < 0 {
                format!("{} doubles before its start", -at)
            } else {
                format!("{} doubles past its end", at - len + 1)
            };
            self.guards.get_or_insert(format!(
                "{call} wrote outside of `{name}` ({len} doubles): {place}"
            ));
        }
    }

    /// An input after a call: unchanged.
    pub(crate) fn unchanged(&mut self, call: &str, name: &str, b: &Guarded, before: &[f64]) {
        self.zones(call, name, b);
        let changed = (0..before.len()).find(|i| b.slice()[*i].to_bits() != before[*i].to_bits());
        if let Some(at) = changed {
            self.guards.get_or_insert(format!(
                "{call} wrote to `{name}`, at {at}: it may only read it"
            ));
        }
    }

    /// An output after a call: whole and finite.
    pub(crate) fn output(&mut self, call: &str, name: &str, b: &Guarded, lanes: usize) {
        self.zones(call, name, b);
        let place = |at: usize| format!("row {}, lane {} of {lanes}", at / lanes, at % lanes);
        if let Some(at) = b.unwritten() {
            let text = format!("{call} did not write `{name}`, {}", place(at));
            self.gaps.get_or_insert(text);
        }
        if let Some(at) = b.slice().iter().position(|v| !v.is_finite()) {
            let text = format!("{call} gave {} in `{name}`, {}", b.slice()[at], place(at));
            self.finite.get_or_insert(text);
        }
    }
}

/// Which of the optional outputs are wanted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) struct Ask {
    /// `fields` of an element and of a patch.
    pub(crate) fields: bool,
    /// What a time step rests on: `critical_step` of an element, `stiffness` of a patch and of a material, `tangent` of
    /// its bending.
    pub(crate) bound: bool,
}

impl Ask {
    pub(crate) const NOTHING: Self = Self::of(false, false);
    pub(crate) const EVERYTHING: Self = Self::of(true, true);
    /// What calls of several threads ask for in turn.
    pub(crate) const HAMMERED: [Self; 2] = [Self::NOTHING, Self::EVERYTHING];
    /// The solver asks for each alone: fields at a frame, the critical step every few steps.
    pub(crate) const ALL: [Self; 4] = [
        Self::NOTHING,
        Self::EVERYTHING,
        Self::of(true, false),
        Self::of(false, true),
    ];

    const fn of(fields: bool, bound: bool) -> Self {
        Self { fields, bound }
    }

    /// In words, with the name of what the time step rests on.
    pub(crate) fn told(self, bound: &str) -> String {
        match (self.fields, self.bound) {
            (false, false) => format!("fields and {bound} are NULL"),
            (true, false) => format!("{bound} is NULL and fields is not"),
            (false, true) => format!("fields is NULL and {bound} is not"),
            (true, true) => format!("neither fields nor {bound} is NULL"),
        }
    }
}

/// Why there is no instance.
#[derive(Debug)]
pub(crate) enum Refusal {
    /// The element says in a text what it does not want.
    Said(String),
    /// It broke the contract.
    Broken(String),
}

impl Refusal {
    /// What `create` of a table made, or why it made nothing.
    pub(crate) fn or_instance(
        create: impl FnOnce(*mut *mut c_void, *mut pf_error) -> i32,
    ) -> Result<*mut c_void, Self> {
        let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
        let code = create(&raw mut instance, &raw mut error);
        if code != PF_OK {
            let text = error.get();
            return Err(match code {
                PF_ERROR if !text.is_empty() => Self::Said(text),
                _ => Self::Broken(format!("create returned {code} with the text '{text}'")),
            });
        }
        if instance.is_null() {
            let text = "create returned 0 (PF_OK) but left the instance NULL";
            return Err(Self::Broken(text.into()));
        }
        Ok(instance)
    }

    pub(crate) fn text(&self) -> &str {
        let (Self::Said(text) | Self::Broken(text)) = self;
        text
    }
}
