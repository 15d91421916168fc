use super::*;
use std::collections::BTreeSet;

fn series(name: &'static str, style: Style, x: &[f64], y: &[f64]) -> Series<'static> {
    Series {
        name: name.into(),
        colour: 0,
        style,
        x: x.to_vec().into(),
        y: y.to_vec().into(),
    }
}

fn plot(series: Vec<Series<'static>>) -> Plot<'static> {
    Plot {
        title: "Force".into(),
        x_label: "shear angle (deg)".into(),
        y_label: "force (N)".into(),
        series,
        size: [560.0, 300.0],
        ..Plot::default()
    }
}

#[test]
fn the_bound_is_drawn_inside_even_when_all_values_are_far_below() {
    let mut p = plot(vec![series("a", Style::Line, &[0.0, 1.0], &[0.0, 0.001])]);
    p.bound = Some((5.0, "bound"));
    p.from_zero = true;
    assert!(p.range([0.0, 0.001].into_iter())[1] >= 5.0);
    assert!(p.svg().into_string().contains("class=\"bound\""));
}

/// All numbers behind `M` and `L` of the paths of a class.
fn places(svg: &str, class: &str) -> Vec<[f64; 2]> {
    let mark = format!("class=\"{class}\" d=\"");
    let mut all = Vec::new();
    for (at, _) in svg.match_indices(&mark) {
        let d = &svg[at + mark.len()..];
        let d = &d[..d.find('"').unwrap()];
        for piece in d.split(['M', 'L']).filter(|p| !p.is_empty()) {
            let piece = piece.trim_end_matches("h0");
            let mut numbers = piece.split([' ', 'm', 'a']).map(|n| n.parse().unwrap());
            all.push([numbers.next().unwrap(), numbers.next().unwrap()]);
        }
    }
    all
}

#[test]
fn a_value_lies_where_its_ticks_say() {
    let p = plot(vec![series(
        "a",
        Style::Line,
        &[0.0, 10.0, 40.0],
        &[0.0, 100.0, -100.0],
    )]);
    let svg = p.svg().into_string();
    let at = places(&svg, "line c0");
    // Texts of ticks with their places: the linear map through two of them gives the values back.
    let tick = |text: &str, anchor: &str| -> [f64; 2] {
        let end = format!("text-anchor=\"{anchor}\">{text}</text>");
        let before = &svg[..svg.find(&end).unwrap()];
        let start = before.rfind("<text").unwrap();
        ["x=\"", "y=\""].map(|key| {
            let from = start + before[start..].find(key).unwrap() + key.len();
            let rest = &before[from..];
            rest[..rest.find('"').unwrap()].parse().unwrap()
        })
    };
    let (x0, x40) = (tick("0", "middle")[0], tick("40", "middle")[0]);
    assert!((at[1][0] - (x0 + 0.25 * (x40 - x0))).abs() < 0.11);
    let (y0, y100) = (tick("0", "end")[1] - 4.0, tick("100", "end")[1] - 4.0);
    assert!((at[0][1] - y0).abs() < 0.11 && (at[1][1] - y100).abs() < 0.11);
    assert!((at[2][1] - (2.0 * y0 - y100)).abs() < 0.21);
}

#[test]
fn gaps_and_odd_numbers_do_not_break_the_picture() {
    let odd = [0.0, f64::NAN, f64::INFINITY, 1e300, 4.0, 5.0];
    let p = plot(vec![series(
        "a",
        Style::Line,
        &odd,
        &[1.0, 1.0, 1.0, 1.0, 2.0, f64::NAN],
    )]);
    let svg = p.svg().into_string();
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    assert_eq!(places(&svg, "line c0").len(), 2);
    let none = plot(vec![series("a", Style::Line, &[f64::NAN], &[1.0])]);
    assert_eq!(none.svg().into_string(), "");
    assert_eq!(plot(vec![]).svg().into_string(), "");
}

#[test]
fn constant_series_and_single_points_are_drawn() {
    for style in [Style::Line, Style::Dashed, Style::Points] {
        for (x, y) in [(vec![1.0], vec![5.0]), (vec![0.0, 1.0], vec![3e9, 3e9])] {
            let svg = plot(vec![series("a", style, &x, &y)]).svg().into_string();
            assert!(svg.contains("</svg>") && !svg.contains("NaN"), "{svg}");
        }
    }
}

#[test]
fn styles_differ_on_the_page_and_in_the_legend() {
    let (x, y) = ([0.0, 1.0], [0.0, 1.0]);
    let all = [Style::Line, Style::Dashed, Style::Points];
    let p = plot(all.map(|s| series("s", s, &x, &y)).to_vec());
    let svg = p.svg().into_string();
    for class in ["line c0", "line dashed c0", "points c0"] {
        let found = svg.matches(&format!("class=\"{class}\"")).count();
        assert_eq!(found, 2, "{class}: once drawn, once in the legend");
    }
    assert!(svg.contains("aria-label=\"Force: force (N), from 0 to 1.04, over shear angle (deg)"));
}

#[test]
fn twelve_series_are_all_told_apart() {
    let (x, y) = (vec![0.0, 1.0], vec![0.0, 1.0]);
    let all = (0..12).map(|i| Series {
        colour: i,
        ..series("s", Style::Line, &x, &y)
    });
    let svg = plot(all.collect()).svg().into_string();
    let legend = &svg[svg.find("<figcaption").unwrap()..];
    let looks: BTreeSet<&str> = legend.split("<span>").skip(1).collect();
    assert_eq!(looks.len(), 12);
}

/// sRGB as linear light.
fn linear(hex: &str) -> [f64; 3] {
    [0, 2, 4].map(|i| {
        let c = f64::from(u8::from_str_radix(&hex[i..i + 2], 16).unwrap()) / 255.0;
        if c <= 0.04045 {
            c / 12.92
        } else {
            ((c + 0.055) / 1.055).powf(2.4)
        }
    })
}

fn times(m: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum())
}

/// Oklab (Ottosson 2020): distances in it are about what eyes tell apart.
fn oklab(rgb: [f64; 3]) -> [f64; 3] {
    const TO_CONES: [[f64; 3]; 3] = [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ];
    const TO_LAB: [[f64; 3]; 3] = [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ];
    times(TO_LAB, times(TO_CONES, rgb).map(|v| v.max(0.0).cbrt()))
}

/// Colours as seen by protanopes, deuteranopes and tritanopes (Machado, Oliveira, Fernandes 2009, severity 1).
const VISION: [[[f64; 3]; 3]; 4] = [
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
];

#[test]
fn colours_stand_out_from_the_page_and_from_each_other_also_for_the_colour_blind() {
    const STYLE: &str = include_str!("../../style.css");
    let schemes: Vec<&str> = STYLE.split("--paper:#").skip(1).collect();
    assert_eq!(schemes.len(), 2, "light and dark");
    let wide = |text: &str| {
        let hex: String = text.chars().take_while(char::is_ascii_hexdigit).collect();
        if hex.len() == 3 {
            hex.chars().flat_map(|c| [c, c]).collect()
        } else {
            hex
        }
    };
    for scheme in schemes {
        let paper = linear(&wide(scheme));
        let colour = |i: usize| {
            let key = format!("--c{i}:#");
            linear(&wide(&scheme[scheme.find(&key).unwrap() + key.len()..]))
        };
        let luminance = |c: [f64; 3]| 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2] + 0.05;
        for i in 0..COLOURS {
            let (a, b) = (luminance(colour(i)), luminance(paper));
            // WCAG 2.1, 1.4.11: graphics against what is beside them.
            assert!(a.max(b) / a.min(b) >= 3.0, "c{i} on the page");
            for (j, eyes) in (0..i).flat_map(|j| VISION.map(|v| (j, v))) {
                let seen = [i, j].map(|k| oklab(times(eyes, colour(k)).map(|v| v.clamp(0.0, 1.0))));
                let apart: f64 = (0..3).map(|d| (seen[0][d] - seen[1][d]).powi(2)).sum();
                assert!(apart.sqrt() > 0.1, "c{i} and c{j}: {}", apart.sqrt());
            }
        }
    }
}

#[test]
fn a_box_stands_between_its_quartiles_and_its_whiskers_and_points_where_they_are_told() {
    let spread = [
        [-4.0, -3.0, -1.0, 0.0, 2.0, 6.0, 8.0],
        [-2.0, -2.0, -1.0, 1.0, 1.0, 3.0, 4.0],
    ];
    let mut p = plot(vec![]);
    p.boxes = vec![Boxes {
        name: "".into(),
        colour: 0,
        x: vec![5.0, 20.0],
        spread: spread.to_vec(),
    }];
    let frame = p.frame().unwrap();
    assert!(frame.y.low <= -4.0 && frame.y.high >= 8.0);
    let svg = p.svg().into_string();
    assert_eq!(svg.matches("<rect").count(), 2);
    assert_eq!(svg.matches("<circle").count(), 4);
    let at = |y: f64| px(frame.y.at(y));
    let height = px(frame.y.at(-1.0) - frame.y.at(2.0));
    for part in [
        format!("y=\"{}\"", at(2.0)),
        format!("height=\"{height}\""),
        format!("V{}", at(6.0)),
        format!("V{}", at(-3.0)),
        format!("cy=\"{}\"", at(8.0)),
        format!("cy=\"{}\"", at(-4.0)),
    ] {
        assert!(svg.contains(&part), "{part}: {svg}");
    }
    // No box reaches out of the field.
    for (at, _) in svg.match_indices("<rect x=\"") {
        let number = |text: &str| -> f64 { text[..text.find('"').unwrap()].parse().unwrap() };
        let x = number(&svg[at + 9..]);
        let width = number(svg[at..].split_once("width=\"").unwrap().1);
        assert!(x >= frame.left && x + width <= frame.right, "{x} {width}");
    }
    assert!(svg.contains("Series: box plots."));
}
