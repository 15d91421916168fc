//! Components through their C tables, as a host sees them.

use plyflow_sdk::abi::*;
use plyflow_sdk::{
    Aligned, BendingBatch, Element, ElementBatch, ElementSizes, Material, MaterialRef,
    MaterialSizes, MembraneBatch, element_table, material_table,
};
use std::ffi::c_void;

struct Linear(f64);

impl Material for Linear {
    const MANIFEST: &'static str = "{}";

    fn create(parameters: &str) -> Result<Self, String> {
        match parameters {
            "panic" => panic!("no such law"),
            text => text
                .parse()
                .map(Self)
                .map_err(|_| format!("modulus: {text} is no number")),
        }
    }

    fn sizes(&self) -> MaterialSizes {
        MaterialSizes {
            membrane_history: 1,
            thickness: 0.1,
            areal_mass: 2.0,
            ..Default::default()
        }
    }

    fn membrane(&self, b: &mut MembraneBatch<'_>) {
        assert!(b.metric[0] < 100.0, "too far");
        for i in 0..b.lanes {
            b.stress[i] = self.0 * (b.metric[i] - 1.0) / 2.0;
            b.history[i] += 1.0;
            b.energy[i] = b.dt;
        }
    }
}

fn create(parameters: &str) -> Result<*mut c_void, (i32, String)> {
    let table = material_table::<Linear>();
    let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
    let p = pf_str::new(parameters);
    // SAFETY: a text, room for the instance and a whole `pf_error`.
    match unsafe { (table.create)(p, &raw mut instance, &raw mut error) } {
        PF_OK => Ok(instance),
        code => Err((code, error.get())),
    }
}

#[test]
fn the_error_of_create_arrives_as_text() {
    assert_eq!(
        create("x"),
        Err((PF_ERROR, "modulus: x is no number".into()))
    );
    let (code, text) = create("panic").unwrap_err();
    assert_eq!(code, PF_PANIC);
    assert!(text.contains("no such law"), "{text}");
}

fn call(material: &MaterialRef, metric: f64, stress: &mut [f64]) -> (i32, f64) {
    let (mut history, mut energy) = (Aligned::zeros(8), Aligned::zeros(8));
    let code = material.membrane(&mut MembraneBatch {
        lanes: 8,
        dt: 0.5,
        metric: &Aligned::filled(metric, 24),
        history: &mut history,
        stress,
        energy: &mut energy,
        stiffness: None,
    });
    (code, history[7] + energy[7])
}

#[test]
fn a_material_works_through_its_table_and_its_panics_become_a_status() {
    let table = material_table::<Linear>();
    let instance = create("4").unwrap();
    let raw = pf_material {
        functions: &raw const table,
        instance,
    };
    // SAFETY: the table and an instance that it has made, both alive to the end of the test.
    let material = unsafe { MaterialRef::new(raw) }.unwrap();
    assert_eq!(material.sizes().thickness, 0.1);
    assert!(!material.sizes().has_bending);
    let mut stress = Aligned::zeros(24);
    assert_eq!(call(&material, 1.5, &mut stress), (PF_OK, 1.5));
    assert_eq!(stress[7], 1.0);
    assert_eq!(call(&material, 1000.0, &mut stress).0, PF_PANIC);
    // SAFETY: made above, ended once; nobody asks `material` any more.
    unsafe { (table.destroy)(instance) };
    // SAFETY: NULL is no instance.
    unsafe { (table.destroy)(std::ptr::null_mut()) };
}

#[test]
#[should_panic(expected = "too short")]
fn a_short_slice_is_refused_before_the_material_writes() {
    let table = material_table::<Linear>();
    let raw = pf_material {
        functions: &raw const table,
        instance: create("4").unwrap(),
    };
    // SAFETY: the table and an instance that it has made, both alive to the end of the test.
    let material = unsafe { MaterialRef::new(raw) }.unwrap();
    call(&material, 1.0, &mut Aligned::zeros(24)[..23]);
}

#[test]
#[should_panic(expected = "64-byte aligned")]
fn a_slice_that_is_not_aligned_is_refused_before_the_material_loads_it() {
    let table = material_table::<Linear>();
    let raw = pf_material {
        functions: &raw const table,
        instance: create("4").unwrap(),
    };
    // SAFETY: the table and an instance that it has made, both alive to the end of the test.
    let material = unsafe { MaterialRef::new(raw) }.unwrap();
    call(&material, 1.0, &mut Aligned::zeros(32)[1..25]);
}

#[test]
fn a_material_without_bending_has_no_moments_though_its_table_has_the_function() {
    let table = material_table::<Linear>();
    let raw = pf_material {
        functions: &raw const table,
        instance: create("4").unwrap(),
    };
    // SAFETY: the table and an instance that it has made, both alive to the end of the test.
    let material = unsafe { MaterialRef::new(raw) }.unwrap();
    let (rows, mut history) = (Aligned::filled(1.0, 24), Aligned::default());
    let [mut moment, mut tangent] = [Aligned::filled(777.0, 24), Aligned::filled(777.0, 24)];
    let mut energy = Aligned::filled(777.0, 8);
    let code = material.bending(&mut BendingBatch {
        lanes: 8,
        dt: 0.0,
        metric: &rows,
        curvature: &rows,
        history: &mut history,
        moment: &mut moment,
        energy: &mut energy,
        tangent: Some(&mut tangent),
    });
    assert_eq!(code, PF_OK);
    assert!(
        [&moment[..], &energy, &tangent]
            .concat()
            .iter()
            .all(|x| *x == 0.0)
    );
}

struct Spring;

impl Element for Spring {
    const MANIFEST: &'static str = "{}";

    fn create(_: &str, material: &MaterialRef) -> Result<Self, String> {
        if material.sizes().areal_mass > 1.0 {
            Ok(Self)
        } else {
            Err("too light".into())
        }
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            nodes: 4,
            dofs_per_node: 3,
            constants: 2,
            material_points: 1,
            ..Default::default()
        }
    }

    fn initialise(&self, b: &mut ElementBatch<'_>, material: &MaterialRef) {
        assert!(b.velocity.is_empty() && b.force.is_empty() && b.spin.is_empty());
        assert_eq!(
            (b.position.len(), b.axis.len(), b.constants.len()),
            (96, 24, 16)
        );
        assert_eq!(
            b.material_history.len(),
            8,
            "points times the material's history"
        );
        b.mass.fill(material.sizes().areal_mass);
    }

    fn forces(&self, _: &mut ElementBatch<'_>, _: &MaterialRef) -> i32 {
        PF_BAD_VALUE
    }
}

#[test]
fn an_element_gets_slices_of_the_documented_sizes() {
    let (materials, table) = (material_table::<Linear>(), element_table::<Spring>());
    let raw = pf_material {
        functions: &raw const materials,
        instance: create("4").unwrap(),
    };
    let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
    let none = std::ptr::null();
    // SAFETY: a text, no material (which is what is tested), room for the instance and a whole `pf_error`.
    let code =
        unsafe { (table.create)(pf_str::new("{}"), none, &raw mut instance, &raw mut error) };
    assert_eq!(code, PF_ERROR);
    assert!(error.get().contains("no material"), "{}", error.get());
    // SAFETY: as above, with a material that lives to the end of the test.
    let code = unsafe {
        (table.create)(
            pf_str::new("{}"),
            &raw const raw,
            &raw mut instance,
            &raw mut error,
        )
    };
    assert_eq!(code, PF_OK);

    let (position, axis) = ([0.5; 96], [0.0; 24]);
    let (mut constants, mut history, mut mass) = ([0.0; 16], [0.0; 8], [0.0; 32]);
    let null = std::ptr::null_mut::<f64>();
    let batch = pf_element_batch {
        size: size_of::<pf_element_batch>() as u64,
        lanes: 8,
        reserved: 0,
        dt: 0.0,
        position: position.as_ptr(),
        velocity: null,
        spin: null,
        axis: axis.as_ptr(),
        constants: constants.as_mut_ptr(),
        history: null,
        material_history: history.as_mut_ptr(),
        force: null,
        moment: null,
        energy: null,
        fields: null,
        mass: mass.as_mut_ptr(),
        inertia: null,
        critical_step: null,
        material: &raw const raw,
    };
    // SAFETY: the instance, and a batch with the arrays that it asks for, of the lengths for its sizes.
    let code = unsafe { (table.initialise)(instance, &raw const batch) };
    assert_eq!(code, PF_OK);
    assert_eq!(mass, [2.0; 32]);
    // SAFETY: as above.
    let code = unsafe { (table.forces)(instance, &raw const batch) };
    assert_eq!(code, PF_BAD_VALUE);
    // SAFETY: made above, ended once.
    unsafe { (table.destroy)(instance) };
}

/// Calls `sizes` with a struct of which only `room` bytes are there; all others must stay as they were.
fn within<T: Copy>(room: usize, of: T, sizes: impl FnOnce(*mut T)) -> T {
    let mut there = of;
    let bytes = (&raw mut there).cast::<u8>();
    // SAFETY: within `there`, which is `room` bytes and the rest; a size fits into the first 8.
    unsafe {
        bytes.write_bytes(0, room);
        bytes.add(room).write_bytes(0xAB, size_of::<T>() - room);
        bytes.cast::<u64>().write(room as u64);
    }
    sizes(&raw mut there);
    // SAFETY: the rest of `there`, all of it written above.
    let left = unsafe { std::slice::from_raw_parts(bytes.add(room), size_of::<T>() - room) };
    assert!(
        left.iter().all(|b| *b == 0xAB),
        "beyond {room} bytes: {left:x?}"
    );
    // SAFETY: the first 8 bytes of `there`.
    let size = unsafe { bytes.cast::<u64>().read() };
    assert_eq!(size, room as u64);
    there
}

#[test]
fn no_more_of_the_sizes_is_written_than_the_caller_has_room_for() {
    let (materials, elements) = (material_table::<Linear>(), element_table::<Spring>());
    let instance = create("4").unwrap();
    let raw = pf_material {
        functions: &raw const materials,
        instance,
    };
    for room in [
        size_of::<u64>(),
        std::mem::offset_of!(pf_material_sizes, areal_mass),
        size_of::<pf_material_sizes>(),
    ] {
        let s = within(room, pf_material_sizes::default(), |s| {
            // SAFETY: the table's instance; a struct of which as much is there as its `size` says.
            let code = unsafe { (materials.sizes)(instance, s) };
            assert_eq!(code, PF_OK);
        });
        if room > size_of::<u64>() {
            assert_eq!((s.membrane_history, s.thickness), (1, 0.1));
        }
        if room == size_of::<pf_material_sizes>() {
            assert_eq!(s.areal_mass, 2.0);
        }
    }
    let mut element = std::ptr::null_mut();
    let (text, none) = (pf_str::new(""), std::ptr::null_mut());
    // SAFETY: a text, a material that lives to the end of the test, room for the instance, and no `pf_error`.
    let code = unsafe { (elements.create)(text, &raw const raw, &raw mut element, none) };
    assert_eq!(code, PF_OK);
    // As ABI 1.0 had it, before `ignores_velocity`.
    let first = std::mem::offset_of!(pf_element_sizes, ignores_velocity);
    for room in [first, size_of::<pf_element_sizes>()] {
        let s = within(room, pf_element_sizes::default(), |s| {
            // SAFETY: as above.
            let code = unsafe { (elements.sizes)(element, s) };
            assert_eq!(code, PF_OK);
        });
        assert_eq!((s.nodes, s.constants, s.material_points), (4, 2, 1));
    }
    // SAFETY: made above, each ended once, the element before its material.
    unsafe {
        (elements.destroy)(element);
        (materials.destroy)(instance);
    }
}
