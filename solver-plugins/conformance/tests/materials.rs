//! The repository's own materials keep the contract.

mod common;

use common::{FILM, ISOTROPIC, WOVEN, ncf, of_material, sound};
use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::isotropic::Isotropic;
use plyflow_kernels::marlow::Marlow;

#[test]
fn nothing_is_found_in_the_repository_s_own_materials() {
    let membrane = ["guard-zones", "threads", "stress", "cycle", "stiffness"];
    sound(&of_material::<Marlow>(FILM), &membrane);
    sound(&of_material::<Isotropic>(ISOTROPIC), &membrane);
    sound(&of_material::<Fabric>(WOVEN), &membrane);
    for form in ["fibre-energy", "hypoelastic"] {
        let checks = of_material::<Fabric>(&ncf(form));
        sound(&checks, &membrane);
        sound(&checks, &["bending", "bending-rest", "moment", "tangent"]);
    }
}
