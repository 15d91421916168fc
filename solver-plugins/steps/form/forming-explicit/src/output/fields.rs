//! Which fields of elements are written.

use crate::error::FormingError;
use crate::request::Parameters;
use plyflow_abi::PF_KIND_ELEMENT;
use plyflow_mechanics::component::{ElementField, element_fields};
use plyflow_model::scene::SheetKind;
use plyflow_sdk::Host;

/// The one field of a film, which plies do not have.
const OF_FILMS: &str = "principal_stretch";

/// Fields of the elements of sheets of a kind.
///
/// # Errors
/// When the host finds no such element.
pub fn fields_of(
    host: &Host,
    kind: SheetKind,
    p: &Parameters,
) -> Result<Vec<ElementField>, FormingError> {
    let of_element = |name: &str| -> Result<Vec<ElementField>, FormingError> {
        let found = host.component(PF_KIND_ELEMENT, name)?;
        Ok(element_fields(
            unsafe { found.manifest.as_str() }.unwrap_or("{}"),
        ))
    };
    let (choice, elsewhere) = match kind {
        SheetKind::Diaphragm => (&p.diaphragm_element, None),
        SheetKind::Ply => (&p.element, p.element_elsewhere.as_ref()),
    };
    let mut list = of_element(&choice.plugin)?;
    if let Some(other) = elsewhere {
        let others = of_element(&other.plugin)?;
        list.iter_mut().for_each(|f| f.find_elsewhere(&others));
    }
    list.retain(|f| (f.name == OF_FILMS) == (kind == SheetKind::Diaphragm));
    Ok(list)
}
