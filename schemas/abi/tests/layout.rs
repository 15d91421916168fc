//! `plyflow.h` and its Rust twin agree: the header is compiled with the machine's C compiler.

use plyflow_abi::*;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::mem::offset_of;
use std::path::Path;
use std::process::Command;

const HEADER: &str = include_str!("../plyflow.h");

/// Struct -> (size, [(field, offset)]) on the Rust side.
type Layouts = Vec<(&'static str, usize, Vec<(&'static str, usize)>)>;

macro_rules! layouts {
    ($($name:ident { $($field:ident),* $(,)? })*) => {
        vec![$((
            stringify!($name),
            size_of::<$name>(),
            vec![$((stringify!($field), offset_of!($name, $field))),*],
        )),*]
    };
}

fn rust_layouts() -> Layouts {
    layouts! {
        pf_str { data, len }
        pf_plugin { magic, abi_major, abi_minor, size, kind, reserved, manifest, functions }
        pf_array_info { dtype, rank, shape }
        pf_progress { size, fraction, simulated_time, rate, energy_ratio, phase }
        pf_component { kind, reserved, functions, manifest }
        pf_services {
            size, host, log, progress, cancelled, fail, threads, parameters, scratch, inputs, item,
            attributes, array_info, array_read, meshes, mesh_read, frame_points_read,
            frame_field_read, attributes_write, array_write, mesh_define, frame_begin, frame_points,
            frame_field, frame_end, result, collection, find_component, checkpoint, checkpoint_due, checkpoint_saved,
        }
        pf_step_functions { size, run }
        pf_error { text }
        pf_writer { host, write }
        pf_material_sizes {
            size, membrane_history, bending_history, has_bending, reserved, thickness, areal_mass,
        }
        pf_membrane_batch {
            size, lanes, reserved, dt, metric, history, stress, energy, stiffness,
        }
        pf_bending_batch {
            size, lanes, reserved, dt, metric, curvature, history, moment, energy, tangent,
        }
        pf_material_functions { size, create, destroy, sizes, membrane, bending, tape }
        pf_material { functions, instance }
        pf_element_sizes {
            size, nodes, dofs_per_node, constants, history, material_points, fields, patch_nodes,
            patch_constants, patch_history, patch_fields, ignores_velocity, reserved,
        }
        pf_element_batch {
            size, lanes, reserved, dt, position, velocity, spin, axis, constants, history,
            material_history, force, moment, energy, fields, mass, inertia, critical_step, material,
        }
        pf_patch_batch {
            size, lanes, reserved, dt, position, count, area, axis, constants, history, force, energy,
            fields, stiffness, material,
        }
        pf_element_functions {
            size, create, destroy, sizes, initialise, forces, patch_initialise, patch_forces, tape,
        }
    }
}

macro_rules! constants {
    ($($name:ident),* $(,)?) => { vec![$((stringify!($name), $name as i64)),*] };
}

fn rust_constants() -> Vec<(&'static str, i64)> {
    constants![
        PF_ABI_MAJOR,
        PF_ABI_MINOR,
        PF_MAGIC,
        PF_KIND_STEP,
        PF_KIND_ELEMENT,
        PF_KIND_MATERIAL,
        PF_OK,
        PF_ERROR,
        PF_CANCELLED,
        PF_PANIC,
        PF_NOT_FOUND,
        PF_BAD_SHAPE,
        PF_BAD_VALUE,
        PF_F64,
        PF_F32,
        PF_I64,
        PF_U32,
        PF_U8,
        PF_MAX_RANK,
        PF_ON_POINTS,
        PF_ON_CELLS,
        PF_LOG_ERROR,
        PF_LOG_WARN,
        PF_LOG_INFO,
        PF_LOG_DEBUG,
        PF_RESULT_MEASURED,
        PF_ERROR_TEXT,
        PF_TAPE_MEMBRANE,
        PF_TAPE_BENDING,
        PF_TAPE_FORCES,
        PF_TAPE_PATCH_FORCES,
        PF_ENERGY_MEMBRANE,
        PF_ENERGY_BENDING,
        PF_ENERGY_HOURGLASS,
        PF_ENERGIES,
    ]
}

/// Names of the header's constants but for the include guard and the symbol's text.
fn header_constants() -> Vec<&'static str> {
    HEADER
        .lines()
        .filter_map(|line| line.strip_prefix("#define "))
        .filter_map(|rest| rest.split_once(' '))
        .map(|(name, _)| name)
        .filter(|name| name.starts_with("PF_") && *name != "PF_SYMBOL")
        .collect()
}

/// Names of the header's structs.
fn header_structs() -> Vec<&'static str> {
    HEADER
        .lines()
        .filter_map(|line| line.strip_prefix("} pf_"))
        .map(|rest| rest.trim_end_matches(';'))
        .collect()
}

/// Compiles a C program that prints `key value` lines and runs it.
fn measured() -> BTreeMap<String, i64> {
    let mut program = String::from(
        "#include <stddef.h>\n#include <stdio.h>\n#include \"plyflow.h\"\nint main(void) {\n",
    );
    for (name, _, fields) in rust_layouts() {
        writeln!(
            program,
            "printf(\"{name} %lld\\n\", (long long)sizeof({name}));"
        )
        .unwrap();
        for (field, _) in fields {
            writeln!(
                program,
                "printf(\"{name}.{field} %lld\\n\", (long long)offsetof({name}, {field}));"
            )
            .unwrap();
        }
    }
    for name in header_constants() {
        writeln!(program, "printf(\"{name} %lld\\n\", (long long)({name}));").unwrap();
    }
    program.push_str("puts(\"PF_SYMBOL=\" PF_SYMBOL);\nreturn 0;\n}\n");
    let folder = std::env::temp_dir().join(format!("plyflow-abi-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let (source, binary) = (folder.join("layout.c"), folder.join("layout"));
    std::fs::write(&source, program).unwrap();
    let status = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()))
        .args(["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-I"])
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")))
        .arg("-o")
        .args([&binary, &source])
        .status()
        .expect("a C compiler (cc) is needed for this test");
    assert!(status.success(), "plyflow.h does not compile as C99");
    let output = Command::new(&binary).output().unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("PF_SYMBOL=plyflow_plugin\n"));
    text.lines()
        .filter_map(|l| l.split_once(' '))
        .map(|(key, value)| (key.to_owned(), value.parse().unwrap()))
        .collect()
}

#[test]
fn sizes_offsets_and_constants_agree_between_header_and_twin() {
    let c = measured();
    for (name, size, fields) in rust_layouts() {
        assert_eq!(c[name], size as i64, "size of {name}");
        for (field, offset) in fields {
            assert_eq!(
                c[&format!("{name}.{field}")],
                offset as i64,
                "offset of {name}.{field}"
            );
        }
    }
    for (name, value) in rust_constants() {
        assert_eq!(c.get(name).copied(), Some(value), "value of {name}");
    }
}

#[test]
fn nothing_of_the_header_is_left_out_of_the_comparison() {
    let structs: Vec<&str> = rust_layouts().iter().map(|(name, ..)| &name[3..]).collect();
    assert_eq!(
        header_structs(),
        structs,
        "structs in the order of the header"
    );
    let constants: Vec<&str> = rust_constants().iter().map(|(name, _)| *name).collect();
    assert_eq!(
        header_constants(),
        constants,
        "constants in the order of the header"
    );
    // Every name that begins a member's declaration is listed: count the semicolons of each struct.
    for (name, _, fields) in rust_layouts() {
        let start = HEADER
            .find(&format!("typedef struct {name} {{"))
            .expect(name);
        let end = start + HEADER[start..].find(&format!("}} {name};")).expect(name);
        let mut body = String::new();
        let mut rest = &HEADER[start..end];
        while let Some(at) = rest.find("/*") {
            body.push_str(&rest[..at]);
            rest = &rest[at + rest[at..].find("*/").expect("a closed comment") + 2..];
        }
        body.push_str(rest);
        assert_eq!(body.matches(';').count(), fields.len(), "members of {name}");
    }
}

#[test]
fn the_symbol_is_the_one_of_the_header() {
    assert_eq!(PF_SYMBOL, b"plyflow_plugin\0");
    assert_eq!(&PF_MAGIC.to_le_bytes(), b"PLYFLOW1");
}
