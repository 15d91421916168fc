//! Files with one mistake each: the error names the right file and line, and says what helps.

mod common;

use common::Study;
use plyflow_workflow::Diagnostics;

const W: &str = "workflow.yaml";
const S: &str = "scene.yaml";
const F: &str = "materials/fabric.yaml";

/// (file, text, replaced by, lines below the start of the replaced text, what the error says)
type Case = (
    &'static str,
    &'static str,
    &'static str,
    usize,
    &'static [&'static str],
);

const CASES: &[Case] = &[
    // The workflow: form.
    (W, "  coarse:\n", "  coarse\n", 1, &["YAML"]),
    (
        W,
        "    from: coarse\n",
        "\tfrom: coarse\n",
        0,
        &["YAML", "tab"],
    ),
    (W, "thesis 5.5.2\"}", "thesis 5.5.2}", 0, &["YAML"]),
    (
        W,
        "plyflow: 1",
        "plyflow: 2",
        0,
        &["version 2", "plyflow: 1"],
    ),
    (W, "plyflow: 1", "plyflow: '1'", 0, &["version"]),
    (W, "plyflow: 1\n", "", 0, &["`plyflow` is missing"]),
    (
        W,
        "name: joggle-spar",
        "name: 5",
        0,
        &["`name`", "text", "quotes"],
    ),
    (
        W,
        "name: joggle-spar",
        "nmae: joggle-spar",
        0,
        &["unknown key `nmae`", "did you mean `name`"],
    ),
    (
        W,
        "on_failure: keep-going",
        "on_failure: keep-goin",
        0,
        &["`keep-going`, `fail-fast`", "did you mean `keep-going`"],
    ),
    (
        W,
        "    retries: 1\n",
        "    retries: 1\n    retries: 2\n",
        1,
        &["`retries` is repeated", "line 15"],
    ),
    (
        W,
        "    retries: 1\n",
        "    retries: 1.5\n",
        0,
        &["`retries`", "whole number"],
    ),
    (W, "cores: 2", "cores: 0", 0, &["`cores`", "at least 1"]),
    (
        W,
        "memory: 4 GiB",
        "memory: 4 gib",
        0,
        &["`memory`", "`GiB`"],
    ),
    (W, "memory: 4 GiB", "memory: 4", 0, &["`memory`", "`4 GiB`"]),
    (
        W,
        "time_limit: 30 min",
        "time_limit: 30",
        0,
        &["`30` has no unit", "a time such as"],
    ),
    (
        W,
        "time_limit: 30 min",
        "time_limit: 30 mm",
        0,
        &["is a length", "a time such as"],
    ),
    (
        W,
        "    plugin: defect-detection\n",
        "    plugn: defect-detection\n",
        0,
        &["unknown key `plugn`", "did you mean `plugin`"],
    ),
    (
        W,
        "  defects:\n    plugin: defect-detection\n",
        "  defects:\n",
        0,
        &["`plugin` is missing in `defects`"],
    ),
    // The workflow: names.
    (
        W,
        "plugin: defect-detection",
        "plugin: defect-detecton",
        0,
        &[
            "no plugin `defect-detecton`",
            "did you mean `defect-detection`",
        ],
    ),
    (
        W,
        "plugin: defect-detection",
        "plugin: m4",
        0,
        &["`m4` is an element plugin, not a step plugin"],
    ),
    (
        W,
        "plugin: defect-detection",
        "plugin: broken",
        0,
        &["ABI 9.0", "rebuild"],
    ),
    (
        W,
        "from: coarse\n",
        "from: corase\n",
        0,
        &["no step `corase`", "did you mean `coarse`"],
    ),
    (
        W,
        "from: {defects: defects}}",
        "from: {defect: defects}}",
        0,
        &["no input", "did you mean `defects`"],
    ),
    (
        W,
        "from: {defects: defects}}",
        "}",
        0,
        &[
            "does not wire its input `defects`",
            "steps that give `defects`: defects",
        ],
    ),
    (
        W,
        "{formed: coarse, zones: zones}",
        "zones",
        0,
        &["has 2 inputs", "formed: .."],
    ),
    (
        W,
        "{formed: coarse, zones: zones}",
        "{formed: defects, zones: zones}",
        0,
        &["takes `forming`", "gives `defects`"],
    ),
    (
        W,
        "{formed: coarse, zones: zones}",
        "{formed: [coarse, local], zones: zones}",
        0,
        &["takes one artifact"],
    ),
    (
        W,
        "{formed: coarse, zones: zones}",
        "{formed: local, zones: zones}",
        0,
        &["wait for each other", "boundary -> local -> boundary"],
    ),
    (
        W,
        "    from: coarse\n",
        "    from: {formed: coarse, formed: coarse}\n",
        0,
        &["`formed` is repeated"],
    ),
    (
        W,
        "      global: coarse\n",
        "      global: local\n",
        0,
        &["one per item of `zones`", "for_each: {zone: zones}"],
    ),
    (
        W,
        "for_each: {zone: zones}",
        "for_each: {zone: defects}",
        0,
        &["not a collection", "zones"],
    ),
    (
        W,
        "for_each: {zone: zones}",
        "for_each: {zone: zone}",
        0,
        &["no step `zone`", "did you mean `zones`"],
    ),
    (
        W,
        "for_each: {zone: zones}",
        "for_each: zones",
        0,
        &["`for_each`", "a mapping", "write `for_each: {zone: zones}`"],
    ),
    // The workflow: parameters.
    (
        W,
        "      contact: penalty\n",
        "      contact: penatly\n",
        0,
        &["`penalty`, `kinematic`", "did you mean `penalty`"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      dampign: 0.1\n",
        0,
        &["no parameter", "did you mean `damping`"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      damping: 1.5\n",
        0,
        &["`damping`", "at most 1"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      damping: '0.1'\n",
        0,
        &["plain number", "remove the quotes"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      write_curvature: yes\n",
        0,
        &["`true` or `false`"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      threads_hint: 100\n",
        0,
        &["at most 64"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      label: 5\n",
        0,
        &["text", "quotes"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      probes:\n        - {x: 1 mm}\n        - {y: 1 mm}\n",
        2,
        &["needs the parameter `x`"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      probes:\n        - {x: 1 mm}\n        - {x: 2}\n",
        2,
        &["`2` has no unit"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      elements: {ply-1: rf5}\n",
        0,
        &["no plugin `rf5`", "did you mean `rf4`"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      table: nowhere.csv\n",
        0,
        &["cannot read `nowhere.csv`"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      damping: 10 %\n",
        0,
        &["plain number", "write `0.1`"],
    ),
    (
        W,
        "      damping: 0.1\n",
        "      tables: up.csv\n",
        0,
        &[
            "`tables` is `up.csv`",
            "a list, each item the path of a file",
            "write `tables: [up.csv]`",
        ],
    ),
    (
        W,
        "      element: m4\n",
        "",
        usize::MAX,
        &["needs the parameter `element`"],
    ),
    (
        W,
        "      element: m4\n",
        "      element: material-fabric\n",
        0,
        &["is a material plugin, not an element plugin"],
    ),
    (
        W,
        "      element: m4\n",
        "      element: {plugin: m4, with: {hourglas: 1}}\n",
        0,
        &["no parameter of `m4`", "`hourglass`"],
    ),
    (
        W,
        "element_size: 8 mm",
        "element_size: 8",
        0,
        &["`8` has no unit", "such as `8 mm`"],
    ),
    (
        W,
        "element_size: 8 mm",
        "element_size: 0",
        0,
        &["`0` has no unit"],
    ),
    (
        W,
        "element_size: 8 mm",
        "element_size: 0 mm",
        0,
        &["more than 0 mm"],
    ),
    (
        W,
        "element_size: 8 mm",
        "element_size: 8 mn",
        0,
        &["unknown unit `mn`"],
    ),
    (
        W,
        "element_size: 8 mm",
        "element_size: 8 ms",
        0,
        &["is a time", "a length"],
    ),
    (
        W,
        "element_size: 8 mm",
        "element_size: 5,5 mm",
        0,
        &["`5,5 mm` has a comma in its number", "write `5.5 mm`"],
    ),
    (
        W,
        "scene: scene.yaml",
        "scene: scnee.yaml",
        0,
        &["cannot read `scnee.yaml`", "did you mean `scene.yaml`"],
    ),
    // The workflow: expectations.
    (
        W,
        "result: zone_count",
        "result: zone_cuont",
        0,
        &["no result", "did you mean `zone_count`"],
    ),
    (
        W,
        "step: comparison, result: zone",
        "step: comparsion, result: zone",
        0,
        &["no step `comparsion`"],
    ),
    (W, "value: 68 mm", "value: 68", 0, &["`68` has no unit"]),
    (
        W,
        "value: 68 mm, tolerance: 7 mm",
        "value: 68 mm, tolerance: 7 deg",
        0,
        &["is an angle"],
    ),
    (W, ", maximum: 0.05", "", 0, &["states nothing"]),
    (
        W,
        "value: 68 mm, ",
        "",
        0,
        &["`tolerance` without `value`", "states nothing"],
    ),
    // The scene.
    (S, "plyflow_scene: 1", "plyflow_scene: 3", 0, &["version 3"]),
    (
        S,
        "    height: 50 mm\n",
        "    height: 50\n",
        0,
        &["`50` has no unit"],
    ),
    (
        S,
        "    height: 50 mm\n",
        "    heigth: 50 mm\n",
        0,
        &["unknown key `heigth`", "`height`"],
    ),
    (
        S,
        "    height: 50 mm\n",
        "    height: -50 mm\n",
        0,
        &["more than 0 mm"],
    ),
    (
        S,
        "    fillet: 10 mm\n",
        "    fillet: 60 mm\n",
        0,
        &["`fillet`", "at most"],
    ),
    (
        S,
        "  joggle_spar:\n",
        "  jogle_spar:\n",
        0,
        &["unknown key `jogle_spar`", "did you mean `joggle_spar`"],
    ),
    (
        S,
        "side_step: [0 mm, 0 mm]",
        "side_step: [0 mm]",
        0,
        &["2 items"],
    ),
    (
        S,
        "start: 100 mm",
        "start: -180 mm",
        0,
        &["before the one above ends"],
    ),
    (S, "start: 100 mm", "start: 300 mm", 0, &["beyond the tool"]),
    (S, "kind: ply", "kind: fabric", 0, &["`ply`, `diaphragm`"]),
    (
        S,
        "    width: 300 mm\n",
        "",
        usize::MAX,
        &["a ply needs `width`"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    outline: {circle: {radius: 80 mm}}\n",
        0,
        &["`width` stands beside `outline`", "of a rectangle"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    holes: [{circle: {radius: 80 mm}}]\n",
        1,
        &["`holes` stand without `outline`", "four points"],
    ),
    (
        S,
        "    length: 480 mm\n    width: 300 mm\n",
        "    outline: [[0 mm, 0 mm], [200 mm, 0 mm]]\n",
        0,
        &["outline has 2 points", "3 to"],
    ),
    (
        S,
        "    length: 480 mm\n    width: 300 mm\n",
        "    outline: [[0 mm, 0 mm], [200 mm, 100 mm], [200 mm, 0 mm], [0 mm, 100 mm]]\n",
        0,
        &[
            "crosses or touches itself",
            "(100, 50) mm",
            "order the points",
        ],
    ),
    (
        S,
        "    length: 480 mm\n    width: 300 mm\n",
        "    outline: {circle: {radius: 80 mm}}\n    holes:\n      - circle: {radius: 20 mm}\n      - circle: {radius: 90 mm}\n",
        3,
        &["holes[1]", "inside of it"],
    ),
    (
        S,
        "    length: 480 mm\n    width: 300 mm\n",
        "    outline: round\n",
        0,
        &["`outline`", "a list of points", "circle"],
    ),
    (
        S,
        "    length: 480 mm\n    width: 300 mm\n",
        "    outline: {circle: {radus: 80 mm}}\n",
        0,
        &["`radus`", "did you mean `radius`"],
    ),
    (
        S,
        "    length: 480 mm\n    width: 300 mm\n",
        "    outline: [[0 mm, 0], [200 mm, 0 mm], [0 mm, 90 mm]]\n",
        0,
        &["has no unit"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    regions:\n      - {name: a, rectangle: {length: 20 mm, width: 310 mm}, friction: {all: 0.1}}\n",
        2,
        &["region 'a' of", "reaches beyond the ply at (-10, -155) mm"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    regions:\n      - {name: a, rectangle: {length: 20 mm, width: 20 mm}, friction: {upper-flim: 0.1}}\n",
        2,
        &["'upper-flim'", "did you mean 'upper-film'"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    regions:\n      - {name: a, rectangle: {length: 20, width: 20 mm}, friction: {all: 0.1}}\n",
        2,
        &["has no unit"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    regions:\n      - {name: a, rectangle: {length: 20 mm, width: 20 mm}, friction: {all: little}}\n",
        2,
        &["`all`"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    regions:\n      - {name: a, rectangle: {length: 20 mm, width: 20 mm}, stitches: remove}\n",
        2,
        &["`removed`"],
    ),
    (
        S,
        "    width: 300 mm\n",
        "    width: 300 mm\n    regions:\n      - name: a\n        rectangle: {length: 20 mm, width: 20 mm}\n        friction: {all: {pressure: {table: [\n          {pressure: 2 kPa, coefficient: 0.3},\n          {pressure: 1 kPa, coefficient: 0.2}]}}}\n",
        6,
        &[
            "`pressure` is `1 kPa`",
            "more than the 2 kPa of the row before",
        ],
    ),
    (
        S,
        "name: upper-film",
        "regions: [{name: a, rectangle: {length: 20 mm, width: 20 mm}, friction: {all: 0.1}}]\n    name: upper-film",
        0,
        &["a diaphragm has no `regions`"],
    ),
    (
        S,
        "name: upper-film",
        "outline: {circle: {radius: 80 mm}}\n    name: upper-film",
        0,
        &["a diaphragm has no `outline`"],
    ),
    (
        S,
        "name: upper-film",
        "length: 1.8 m\n    name: upper-film",
        0,
        &["a diaphragm has no `length`", "frame of the process"],
    ),
    (
        S,
        "name: upper-film",
        "fibre_1: 45 deg\n    name: upper-film",
        0,
        &["a diaphragm has no `fibre_1`", "no fibres"],
    ),
    (
        S,
        "name: upper-film",
        "name: lower-film",
        0,
        &["`lower-film` is taken"],
    ),
    (
        S,
        "name: upper-film",
        "name: bed",
        0,
        &["`bed` is taken", "`die` and `holder`"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: {pressure: {power: {reference: 1 bar, exponent: -0.2}}}",
        0,
        &["has no `coefficient`", "from 0 to 2"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: {coefficient: 0.5, pressure: {power: {reference: 1 bar, exponent: -1}}}",
        0,
        &["`exponent` is the number -1", "more than -1"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: {coefficient: 0.5, pressure: {table: [{pressure: 1 kPa, coefficient: 0.4}, {pressure: 2 kPa, coefficient: 0.3}]}}",
        0,
        &["`coefficient` stands beside a table"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: {pressure: {table: [{pressure: 1 kPa, coefficient: 0.4}, {pressure: 1 kPa, coefficient: 0.3}]}}",
        0,
        &["`pressure` is `1 kPa`", "more than the 1 kPa"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: {pressure: {table: [{pressure: 1 kPa, coefficient: 0.4}]}}",
        0,
        &["the table has one row", "growing `pressure`"],
    ),
    (
        S,
        "fabric_diaphragm: 0.40",
        "fabric_diaphragm: {coefficient: 0.5, angle: {factors: [{angle: 0 deg, factor: 1}, {angle: 90 deg, factor: 4.5}]}}",
        0,
        &["`factor` is the number 4.5", "at most 2 in all (here 2.25)"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: 5.1",
        0,
        &["at most 2"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: 0.51 N",
        0,
        &["plain number"],
    ),
    (
        S,
        "  fabric_diaphragm: 0.40\n",
        "",
        usize::MAX,
        &["`fabric_diaphragm` is missing in `friction`"],
    ),
    (
        S,
        "forming_pressure: 1e5 Pa",
        "forming_pressure: 1e5 Pas",
        0,
        &["unknown unit `Pas`", "`Pa`"],
    ),
    (
        S,
        "bag_pressure: 1 bar",
        "bag_pressure: {table: [{share: 0, pressure: 0 kPa}, {share: 1.5, pressure: 1 bar}]}",
        0,
        &["at most 1"],
    ),
    (
        S,
        "bag_pressure: 1 bar",
        "bag_pressure: [0 kPa, 1 bar]",
        0,
        &["`bag_pressure`", "a pressure such as `1 bar`", "{table: ["],
    ),
    (
        S,
        "    film_joint_margin: 60 mm\n",
        "    film_joint_margin: 60 mm\n    film_pre_stretch: 1 %\n",
        1,
        &["`film_pre_stretch` is `1 %`", "write `0.01`"],
    ),
    (
        S,
        "tool_diaphragm: 0.51",
        "tool_diaphragm: 0,51",
        0,
        &["plain number", "write `0.51`"],
    ),
    // The scene as a whole.
    (
        S,
        "forming_pressure: 1e5 Pa",
        "forming_pressure: 0 Pa",
        0,
        &["`forming_pressure` is `0 Pa`", "nothing is formed"],
    ),
    (
        S,
        "    draft: 10 deg\n",
        "    draft: 58 deg\n",
        0,
        &["`draft` is `58 deg`", "at most 57 deg"],
    ),
    (
        S,
        "    fillet: 10 mm\n",
        "    fillet: 0 mm\n",
        0,
        &["`fillet` is `0 mm`", "more than 0 mm"],
    ),
    (
        S,
        "friction:\n",
        "symmetry: [y]\nfriction:\n",
        0,
        &[
            "the tool is not its own mirror image in the plane y = 0",
            "out of `symmetry`",
        ],
    ),
    (
        S,
        "  - name: upper-film\n    kind: diaphragm\n    material: film.yaml\n",
        "    regions:\n      - {name: a, rectangle: {length: 20 mm, width: 20 mm}, friction: {upper-film: {coefficient: 0.5, angle: {factors: [{angle: 0 deg, factor: 1}, {angle: 90 deg, factor: 1.5}]}}}}\n  - name: upper-film\n    kind: diaphragm\n    material: film.yaml\nsymmetry: [x]\n",
        5,
        &["which the plane exchanges with the other one in sheet `ply-1`"],
    ),
    (
        S,
        "    joggles:\n",
        "    corner: 1 mm\n    joggles:\n",
        0,
        &["`corner` is `1 mm`", "at least"],
    ),
    (
        S,
        "name: ply-1",
        "name: tool",
        0,
        &["the name `tool` is taken"],
    ),
    (
        S,
        "fabric_diaphragm: 0.40",
        "fabric_diaphragm: {coefficient: 0.5, angle: {of: lower, factors: [{angle: 0 deg, factor: 1}, {angle: 90 deg, factor: 1.5}]}}",
        0,
        &["(lower) and `ply-1` (upper) has no fibres", "no `of`"],
    ),
    (
        S,
        "  - name: upper-film\n    kind: diaphragm\n    material: film.yaml\n",
        "",
        usize::MAX,
        &[
            "do not make a stack for `double_diaphragm`: from the tool upwards they are 1 diaphragm, 1 ply",
            "a diaphragm above it",
        ],
    ),
    (
        S,
        "  - name: lower-film\n    kind: diaphragm\n    material: film.yaml\n",
        "",
        1,
        &["they are 1 ply, 1 diaphragm", "a diaphragm below it"],
    ),
    (
        S,
        "  - name: upper-film\n",
        "  - {name: middle, kind: diaphragm, material: film.yaml}\n  - name: upper-film\n",
        0,
        &[
            "they are 1 diaphragm, 1 ply, 2 diaphragms",
            "no further diaphragm here",
        ],
    ),
    (
        S,
        "  diaphragm_diaphragm: 0.5\n",
        "  diaphragm_diaphragm: 0.5\n  pairs:\n    - {between: [tool, lower-flim], coefficient: 0.3}\n",
        2,
        &[
            "no surface of this scene is called `lower-flim`",
            "`bed`",
            "did you mean `lower-film`",
        ],
    ),
    (
        S,
        "  diaphragm_diaphragm: 0.5\n",
        "  diaphragm_diaphragm: 0.5\n  pairs:\n    - {between: [die, ply-1], coefficient: 0.3}\n",
        2,
        &["no surface of this scene is called `die`"],
    ),
    (
        S,
        "  diaphragm_diaphragm: 0.5\n",
        "  diaphragm_diaphragm: 0.5\n  pairs:\n    - {between: [tool, ply-1], coefficient: 0.3}\n",
        2,
        &[
            "`tool` and `ply-1` do not rub on each other",
            "`[lower-film, ply-1]`",
        ],
    ),
    (
        S,
        "  diaphragm_diaphragm: 0.5\n",
        "  diaphragm_diaphragm: 0.5\n  pairs:\n    - {between: [tool, lower-film], coefficient: 0.3}\n    - {between: [lower-film, tool], coefficient: 0.4}\n",
        3,
        &[
            "the pair of `lower-film` and `tool` is named twice",
            "in line 34 already",
        ],
    ),
    (
        S,
        "forming_pressure: 1e5 Pa",
        "forming_pressure: 1.2 bar",
        0,
        &[
            "`forming_pressure` is `1.2 bar`",
            "at most `bag_pressure` (1 bar)",
        ],
    ),
    (
        S,
        "forming_pressure: 1e5 Pa",
        "forming_pressure: {table: [{share: 0, pressure: 0 kPa}, {share: 1, pressure: 101 kPa}]}",
        0,
        &["`pressure` is `101 kPa`", "at most `bag_pressure` (1 bar)"],
    ),
    (
        S,
        "bag_pressure: 1 bar",
        "bag_pressure: {table: [{share: 0, pressure: 0 kPa}, {share: 1, pressure: 60 kPa}]}",
        1,
        &["`forming_pressure` is `1e5 Pa`", "(60 kPa at its end)"],
    ),
    (
        S,
        "bag_pressure: 1 bar",
        "bag_pressure: {table: [{share: 0, pressure: 0 kPa}, {share: 0.9, pressure: 1 bar}]}",
        0,
        &["`share` is the number 0.9", "1 in the last row"],
    ),
    (
        S,
        "fibre_2: -45 deg",
        "fibre_2: 227 deg",
        0,
        &[
            "`fibre_1` and `fibre_2` lie along each other, 2 deg apart",
            "at 6 deg or more",
        ],
    ),
    (
        S,
        "frame_length: 1.8 m",
        "frame_length: 400 mm",
        0,
        &[
            "`frame_length` is `400 mm`",
            "more than the 480 mm that ply `ply-1` takes",
        ],
    ),
    (
        S,
        "materials/fabric.yaml",
        "materials/fabirc.yaml",
        0,
        &["cannot read", "did you mean `fabric.yaml`"],
    ),
    // The material.
    (
        F,
        "  fibre_modulus: 3 GPa\n",
        "  fibre_modulus: 3 Gpa\n",
        0,
        &["unknown unit `Gpa`", "`GPa`"],
    ),
    (
        F,
        "  fibre_modulus: 3 GPa\n",
        "",
        usize::MAX,
        &["needs the parameter `fibre_modulus`"],
    ),
    (
        F,
        "  shear: 112.19 N/m\n",
        "  shaer: 112.19 N/m\n",
        0,
        &["no parameter of `material-fabric`", "did you mean `shear`"],
    ),
    (
        F,
        "areal_mass: 440 g/m2",
        "areal_mass: 440 g/m3",
        0,
        &["is a density", "an areal mass"],
    ),
    (
        F,
        "plugin: material-fabric",
        "plugin: material-fabrik",
        0,
        &["did you mean `material-fabric`"],
    ),
    (
        F,
        "plugin: material-fabric",
        "plugin: rf4",
        0,
        &["is an element plugin, not a material plugin"],
    ),
    (
        F,
        "thickness: 0.4 mm",
        "thickness: [0.4 mm]",
        0,
        &["`thickness` is a list"],
    ),
];

fn findings(study: &Study) -> Diagnostics {
    match study.load() {
        Ok(_) => panic!("nothing was found"),
        Err(d) => d,
    }
}

#[test]
fn every_mutation_is_reported_in_its_file_and_line() {
    assert!(CASES.len() >= 40);
    let mut failures = Vec::new();
    for (file, from, to, below, says) in CASES {
        let study = Study::sound();
        let mut line = study.mutate(file, from, to);
        // What is missing is reported at the mapping that lacks it (a ply: at its kind), which stands
        // above the removed line.
        let given_line = *below != usize::MAX;
        line += if given_line { *below } else { 0 };
        let found = match study.load() {
            Ok(_) => {
                failures.push(format!("{from:?} -> {to:?}: nothing was found"));
                continue;
            }
            Err(d) => d,
        };
        let path = study.path(file);
        let hit = found.items.iter().any(|d| {
            let text = format!(
                "{} {} {}",
                d.message,
                d.expected.as_deref().unwrap_or_default(),
                d.help.as_deref().unwrap_or_default()
            );
            d.file == path
                && (d.line == line || (!given_line && d.line < line && d.line > 0))
                && d.column > 0
                && text.contains(says[0])
        });
        let all = found.to_string() + &found.render(false);
        let says_all = says.iter().all(|s| all.contains(s));
        if !hit || !says_all {
            failures.push(format!(
                "{from:?} -> {to:?}: line {line} of {file}, {says:?}\n{}",
                found.render(false)
            ));
        }
    }
    assert!(
        failures.is_empty(),
        "{} of {}:\n{}",
        failures.len(),
        CASES.len(),
        failures.join("\n")
    );
}

#[test]
fn friction_is_asked_for_where_surfaces_touch() {
    let found = |from: &str, to: &str| {
        let study = Study::sound();
        study.mutate(S, from, to);
        study
            .load()
            .err()
            .map(|d| d.to_string())
            .unwrap_or_default()
    };
    // One ply needs no friction between plies; two do.
    assert_eq!(found("  fabric_fabric: 0.35\n", ""), "");
    let study = Study::sound();
    study.mutate(S, "  fabric_fabric: 0.35\n", "");
    let second = "  - {name: ply-2, kind: ply, material: materials/fabric.yaml, length: 480 mm, width: 300 mm}\n  - name: upper-film";
    study.mutate(S, "  - name: upper-film", second);
    let two = findings(&study).to_string();
    assert!(two.contains("`fabric_fabric` is missing"), "{two}");
    // A press touches the plies with tool, die and holder.
    let press = "process:\n  press:\n    stroke: 50 mm\n    forming_time: 1 s\n    settling_time: 0 s\n    die: {opening_radius: 53 mm, edge_radius: 6 mm}\n#";
    let missing = found("process:", press);
    assert!(missing.contains("`tool_fabric` is missing"), "{missing}");
}

#[test]
fn one_mistake_gives_no_crowd_of_errors() {
    for (file, from, to, _, _) in CASES {
        let study = Study::sound();
        study.mutate(file, from, to);
        let n = findings(&study).items.len();
        assert!(
            n <= 2,
            "{from:?} -> {to:?}: {n} errors\n{}",
            findings(&study).render(false)
        );
    }
}

#[test]
fn all_mistakes_of_all_files_are_found_in_one_pass() {
    let study = Study::sound();
    let mut wanted = Vec::new();
    for (file, from, to) in [
        (W, "on_failure: keep-going", "on_failure: never"),
        (W, "element_size: 8 mm", "element_size: 8"),
        (W, "contact: penalty", "contact: glue"),
        (W, "time_limit: 30 min", "time_limit: 30 mm"),
        (W, "over_shear_positive: 8 deg", "over_shear_positive: 8 mm"),
        (W, "plugin: zone-extraction", "plugin: zone-extractor"),
        (W, "for_each: {zone: zones}", "for_each: {zone: coarse}"),
        (W, "element: rf4", "element: rf44"),
        (W, "global: coarse", "globl: coarse"),
        (W, "maximum: 0.05", "maximum: 0.05 m"),
        (S, "draft: 10 deg", "draft: 80 deg"),
        (S, "kind: ply", "kind: sheet"),
        (S, "fabric_fabric: 0.35", "fabric_fabric: 3.5"),
        (F, "thickness: 0.4 mm", "thickness: 0.4"),
        (F, "shear: 112.19 N/m", "shear: 112.19 N"),
    ] {
        let line = study.mutate(file, from, to);
        wanted.push((study.path(file), line));
    }
    let found = findings(&study);
    for (file, line) in wanted {
        assert!(
            found.items.iter().any(|d| d.file == file && d.line == line),
            "{file}:{line}\n{}",
            found.render(false)
        );
    }
    // A file that two steps read is reported once.
    let mut places: Vec<String> = found
        .items
        .iter()
        .map(|d| format!("{}:{}:{}", d.file, d.line, d.message))
        .collect();
    let n = places.len();
    places.sort();
    places.dedup();
    assert_eq!(places.len(), n, "{}", found.render(false));
}

#[test]
fn a_cycle_is_shown_with_its_path() {
    let study = Study::sound();
    let line = study.mutate(
        W,
        "  zones: {plugin: zone-extraction, from: {defects: defects}}",
        "  zones: {plugin: zone-extraction, from: {defects: zones}}",
    );
    let found = findings(&study);
    assert!(
        found
            .items
            .iter()
            .any(|d| d.line == line && d.message.contains("zones -> zones")),
        "{found}"
    );
}

#[test]
fn findings_as_json_have_place_value_expectation_and_remedy() {
    let study = Study::sound();
    let line = study.mutate(W, "element_size: 8 mm", "element_size: 8");
    let json = findings(&study).to_json();
    let wanted = serde_json::json!([{
        "file": study.path(W), "line": line, "column": 21, "severity": "error",
        "message": "`element_size`: `8` has no unit", "given": "8",
        "expected": "a length such as `5 mm`",
        "help": "write the unit after the number, such as `8 mm`"
    }]);
    assert_eq!(json, wanted);
}

#[test]
fn findings_as_text_show_the_line_with_a_caret() {
    let study = Study::sound();
    let line = study.mutate(W, "element_size: 8 mm", "element_size: 8 ms");
    let text = findings(&study).render(false);
    assert!(
        text.contains(&format!("workflow.yaml:{line}:21]")),
        "{text}"
    );
    assert!(
        text.contains("      element_size: 8 ms") && text.contains("──┬─"),
        "{text}"
    );
    assert!(
        text.contains("expected a length such as `5 mm`") && text.contains("1 error"),
        "{text}"
    );
}

#[test]
fn a_missing_workflow_file_is_named() {
    let error = plyflow_workflow::load("/nowhere/w.yaml".into(), &common::catalog()).unwrap_err();
    assert!(
        error.render(false).contains("/nowhere/w.yaml"),
        "{}",
        error.render(false)
    );
    assert!(error.has_errors());
}

#[test]
fn a_missing_plugin_folder_is_reported() {
    let study = Study::sound();
    let line = study.mutate(W, "steps:", "plugins: [./plugns]\nsteps:");
    let found = findings(&study);
    assert_eq!(found.items[0].line, line, "{found}");
}
