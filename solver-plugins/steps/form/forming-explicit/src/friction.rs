//! Which surfaces of a scene rub on each other, and by which law.

use crate::regions::{self, Placed};
use plyflow_fixed::FixedBits;
use plyflow_mechanics::contact::{
    AngleDependence, FibreField, FrictionLaw, LARGEST_COEFFICIENT, Partner, PressureDependence,
    RegionalFriction, SheetCells, VaryingFriction, Whose,
};
use plyflow_mechanics::model::Model;
use plyflow_model::friction::{self as scene, AngleLaw, Coefficient, Place, PressureLaw};
use plyflow_model::nearest::nearest;
use plyflow_model::scene::{Process, Scene, Sheet, SheetKind};
use std::sync::Arc;

/// Two surfaces that touch, the lower one first, and their class.
#[derive(Debug, Clone, PartialEq)]
struct Pair {
    parts: [String; 2],
    class: &'static str,
}

impl Pair {
    fn names(&self) -> [&str; 2] {
        self.parts.each_ref().map(String::as_str)
    }
}

/// The friction of a scene, checked against the surfaces that it has.
pub struct FrictionTable<'a> {
    scene: &'a Scene,
    pairs: Vec<Pair>,
}

/// The contact for which a law is asked.
pub struct Touching<'a> {
    /// Names of the two surfaces, the lower one first.
    pub parts: [&'a str; 2],
    /// Name of the sheet whose nodes touch.
    pub slave: &'a str,
}

/// Pairs of a scene in which friction acts.
fn pairs(scene: &Scene) -> Vec<Pair> {
    let sheets = &scene.sheets;
    let pair = |lower: &str, upper: &str, class| Pair {
        parts: [lower.into(), upper.into()],
        class,
    };
    let (Some(first), Some(last)) = (sheets.first(), sheets.last()) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    match &scene.process {
        Process::DoubleDiaphragm(_) => {
            found.push(pair("tool", &first.name, "tool_diaphragm"));
            found.push(pair("bed", &first.name, "tool_diaphragm"));
        }
        Process::Press(press) => {
            found.push(pair("tool", &first.name, "tool_fabric"));
            found.push(pair(&last.name, "die", "tool_fabric"));
            if press.holder.is_some() {
                found.push(pair("holder", &first.name, "tool_fabric"));
            }
        }
    }
    for two in sheets.windows(2) {
        found.push(pair(&two[0].name, &two[1].name, class(&two[0], &two[1])));
    }
    // Past the edges of what lies between them any two sheets may touch: plies slide on each other.
    for (i, lower) in sheets.iter().enumerate() {
        for upper in sheets.iter().skip(i + 2) {
            if class(lower, upper) != "diaphragm_diaphragm" {
                found.push(pair(&lower.name, &upper.name, class(lower, upper)));
            }
        }
    }
    if let Process::Press(press) = &scene.process {
        let holder = press.holder.as_ref().map(|_| "holder");
        for part in ["tool", "die"].into_iter().chain(holder) {
            let plies = sheets.iter().filter(|s| s.kind == SheetKind::Ply);
            let new: Vec<Pair> = (plies.map(|ply| pair(part, &ply.name, "tool_fabric")))
                .filter(|p| !found.iter().any(|f| same(&f.parts, p.names())))
                .collect();
            found.extend(new);
        }
    }
    // Beyond the plies the two films meet.
    if sheets.len() > 2 && matches!(scene.process, Process::DoubleDiaphragm(_)) {
        found.push(pair(&first.name, &last.name, class(first, last)));
    }
    found
}

/// Class of two sheets.
fn class(a: &Sheet, b: &Sheet) -> &'static str {
    match (a.kind, b.kind) {
        (SheetKind::Ply, SheetKind::Ply) => "fabric_fabric",
        (SheetKind::Diaphragm, SheetKind::Diaphragm) => "diaphragm_diaphragm",
        _ => "fabric_diaphragm",
    }
}

/// Whether two pairs of names are the same, in either order.
fn same(a: &[String; 2], b: [&str; 2]) -> bool {
    (a[0] == b[0] && a[1] == b[1]) || (a[0] == b[1] && a[1] == b[0])
}

impl<'a> FrictionTable<'a> {
    /// The table of a scene.
    ///
    /// # Errors
    /// When a pair names surfaces that the scene does not have or that do not touch, or one that another pair names too; when
    /// a law makes no sense.
    pub fn new(scene: &'a Scene) -> Result<Self, String> {
        let pairs = pairs(scene);
        let table = Self { scene, pairs };
        for k in 0..scene.friction.pairs.len() {
            table.check_pair(k)?;
        }
        let f = &scene.friction;
        for (class, given) in [
            ("tool_diaphragm", &f.tool_diaphragm),
            ("tool_fabric", &f.tool_fabric),
            ("fabric_diaphragm", &f.fabric_diaphragm),
            ("fabric_fabric", &f.fabric_fabric),
            ("diaphragm_diaphragm", &f.diaphragm_diaphragm),
        ] {
            match given {
                Some(Coefficient::Law(law)) => check_law(law, &format!("friction.{class}"))?,
                Some(Coefficient::Constant(n)) => {
                    check_coefficient(n.0, &format!("friction.{class}"))?
                }
                None => {}
            }
        }
        for sheet in &scene.sheets {
            for region in &sheet.regions {
                for (partner, given) in &region.friction {
                    let place = place(sheet, &region.name, partner);
                    match given {
                        Coefficient::Law(law) => check_law(law, &place)?,
                        Coefficient::Constant(n) => check_coefficient(n.0, &place)?,
                    }
                }
            }
        }
        Ok(table)
    }

    fn check_pair(&self, k: usize) -> Result<(), String> {
        let given = &self.scene.friction.pairs[k];
        let place = format!("friction.pairs[{k}]");
        let mut names: Vec<&str> = Vec::new();
        for name in self.pairs.iter().flat_map(|p| &p.parts) {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        for name in &given.between {
            if !names.contains(&name.as_str()) {
                let hint = nearest(name, names.iter().copied());
                let hint = hint.map_or(String::new(), |n| format!("; did you mean '{n}'?"));
                return Err(format!(
                    "{place}.between: no surface of scene '{}' is called '{name}'; expected two of: {}{hint}",
                    self.scene.name,
                    names.join(", ")
                ));
            }
        }
        let clash = |s: &&Sheet| ["tool", "bed", "die", "holder"].contains(&s.name.as_str());
        if let Some(sheet) = self.scene.sheets.iter().find(clash) {
            return Err(format!(
                "{place}.between: sheet '{}' has the name of a rigid surface; give the sheet another name",
                sheet.name
            ));
        }
        let between = given.between.each_ref().map(String::as_str);
        if !self.pairs.iter().any(|p| same(&p.parts, between)) {
            let all = self.pairs.iter().map(|p| p.parts.join(" and "));
            return Err(format!(
                "{place}.between: {} and {} do not rub on each other in scene '{}'; expected one of: {}",
                between[0],
                between[1],
                self.scene.name,
                all.collect::<Vec<_>>().join("; ")
            ));
        }
        let before = self.scene.friction.pairs[..k].iter();
        if let Some(j) = before
            .enumerate()
            .find_map(|(j, p)| same(&p.between, between).then_some(j))
        {
            return Err(format!(
                "{place}.between: {} and {} are already the pair of friction.pairs[{j}]; remove one of the two",
                between[0], between[1]
            ));
        }
        check_law(&given.law(), &place)
    }

    /// The law of a contact, and how to make it in a model.
    ///
    /// # Errors
    /// When the scene does not give it, or when whose fibres count is not clear.
    pub fn law(&self, model: &Model, touching: &Touching<'_>) -> Result<FrictionLaw, String> {
        self.by_region(model, touching, true)
    }

    /// The law of a contact with what its surfaces' regions say. `cells`: whether its nodes touch cells of the other surface.
    fn by_region(
        &self,
        model: &Model,
        touching: &Touching<'_>,
        cells: bool,
    ) -> Result<FrictionLaw, String> {
        let mut laws = vec![self.everywhere(model, touching)?];
        let [lower, upper] = touching.parts;
        // The surface whose nodes touch comes first; of two between which they do not, the lower one.
        let (own, other) = match touching.slave == upper {
            true => (upper, lower),
            false => (lower, upper),
        };
        let mut of = |name: &str, partner: &str| -> Result<Vec<(Placed<'a>, u16)>, String> {
            let Some(sheet) = self.scene.sheets.iter().find(|s| s.name == name) else {
                return Ok(Vec::new());
            };
            let class = self.class(touching.parts);
            let mut found = Vec::new();
            for placed in regions::of_sheet(sheet)? {
                let law = match placed.region.coefficient(partner, class) {
                    None => continue,
                    Some(Coefficient::Constant(n)) => n.0.into(),
                    Some(Coefficient::Law(law)) => {
                        let at = place(sheet, &placed.region.name, partner);
                        self.make(law, &at, model, touching)?
                    }
                };
                found.push((placed, laws.len() as u16));
                laws.push(law);
            }
            Ok(found)
        };
        let (near, far) = (of(own, other)?, of(other, own)?);
        if laws.len() == 1 {
            return Ok(laws.swap_remove(0));
        }
        let slave = regions::by_node(model, touching.slave, &near);
        let partner = if far.is_empty() {
            Partner::Bare
        } else if cells {
            let (cells, first) = self::cells(model, other);
            Partner::Sheet {
                laws: regions::by_node(model, other, &far),
                cells: cells.to_vec(),
                first_cell: first as u32,
            }
        } else {
            Partner::Between(regions::by_node(model, touching.slave, &far))
        };
        Ok(FrictionLaw::Regional(Arc::new(RegionalFriction {
            laws,
            slave,
            partner,
        })))
    }

    /// The law of a contact outside of all regions.
    fn everywhere(&self, model: &Model, touching: &Touching<'_>) -> Result<FrictionLaw, String> {
        let f = &self.scene.friction;
        let mut own = f.pairs.iter().enumerate();
        if let Some((k, given)) = own.find(|(_, p)| same(&p.between, touching.parts)) {
            return self.make(
                &given.law(),
                &format!("friction.pairs[{k}]"),
                model,
                touching,
            );
        }
        let class = self.class(touching.parts);
        let given = match class {
            "tool_diaphragm" => &f.tool_diaphragm,
            "tool_fabric" => &f.tool_fabric,
            "fabric_diaphragm" => &f.fabric_diaphragm,
            "fabric_fabric" => &f.fabric_fabric,
            _ => &f.diaphragm_diaphragm,
        };
        match given {
            Some(Coefficient::Constant(n)) => Ok(n.0.into()),
            Some(Coefficient::Law(law)) => {
                self.make(law, &format!("friction.{class}"), model, touching)
            }
            None => Err(format!(
                "friction.{class}: not given, but in this scene {} and {} touch; expected a coefficient",
                touching.parts[0], touching.parts[1]
            )),
        }
    }

    /// The law of two sheets that touch past the edges of those between them. Where the scene gives none for the two, that of the pair
    /// of neighbours with the least coefficient, as in [`FrictionTable::through`]. `chain`: the names from the lower to the upper one.
    ///
    /// # Errors
    /// When the scene does not give one of them.
    pub fn past(&self, model: &Model, chain: &[&str], slave: &str) -> Result<FrictionLaw, String> {
        let parts = [chain[0], chain[chain.len() - 1]];
        let f = &self.scene.friction;
        let named = f.pairs.iter().any(|p| same(&p.between, parts));
        let class = match self.class(parts) {
            "fabric_fabric" => f.fabric_fabric.is_some(),
            "fabric_diaphragm" => f.fabric_diaphragm.is_some(),
            _ => f.diaphragm_diaphragm.is_some(),
        };
        if named || class {
            self.law(model, &Touching { parts, slave })
        } else {
            self.through(model, chain, slave)
        }
    }

    /// The law of a sheet that a rigid part holds through the sheets between the two: of the surfaces that could slide the one
    /// with the least coefficient under 1 bar. `parts`: from the rigid part to the sheet or back, lower ones first; `sheet`: its
    /// name, one end of them. A law by the angle to fibres of another sheet counts without the angle.
    ///
    /// # Errors
    /// When the scene does not give one of them.
    pub fn through(
        &self,
        model: &Model,
        parts: &[&str],
        sheet: &str,
    ) -> Result<FrictionLaw, String> {
        let mut laws: Vec<FrictionLaw> = Vec::new();
        for two in parts.windows(2) {
            let touching = Touching {
                parts: [two[0], two[1]],
                slave: sheet,
            };
            let law = self.by_region(model, &touching, false)?;
            laws.push(without_fibres_of_others(law));
        }
        if laws.iter().any(|l| matches!(l, FrictionLaw::Regional(_))) {
            return Ok(regions::least(model, sheet, &laws));
        }
        let lesser = |a: FrictionLaw, b| {
            if at_one_bar(&b) < at_one_bar(&a) {
                b
            } else {
                a
            }
        };
        Ok(laws
            .into_iter()
            .reduce(lesser)
            .unwrap_or_else(|| 0.0.into()))
    }

    /// Class of two surfaces. In a zone that not every ply reaches, others touch than in the whole scene.
    fn class(&self, parts: [&str; 2]) -> &'static str {
        if let Some(pair) = self.pairs.iter().find(|p| same(&p.parts, parts)) {
            return pair.class;
        }
        let sheet = |name: &str| self.scene.sheets.iter().find(|s| s.name == name);
        match parts.map(sheet) {
            [Some(a), Some(b)] => class(a, b),
            [Some(s), None] | [None, Some(s)] if s.kind == SheetKind::Ply => "tool_fabric",
            _ => "tool_diaphragm",
        }
    }

    fn make(
        &self,
        law: &scene::FrictionLaw,
        place: &str,
        model: &Model,
        touching: &Touching<'_>,
    ) -> Result<FrictionLaw, String> {
        let pressure = match (&law.pressure, law.coefficient) {
            (None, Some(c)) if law.angle.is_none() => return Ok(c.0.into()),
            (None, c) => PressureDependence::Constant(c.map_or(0.0, |c| c.0)),
            (Some(PressureLaw::Power(p)), c) => PressureDependence::Power {
                coefficient: c.map_or(0.0, |c| c.0),
                reference: p.reference.si(),
                exponent: p.exponent.0,
            },
            (Some(PressureLaw::Table(rows)), _) => {
                let rows = rows.iter().map(|r| [r.pressure.si(), r.coefficient.0]);
                PressureDependence::Table(rows.collect())
            }
        };
        let angle = match &law.angle {
            None => None,
            Some(a) => Some(self.angle(a, &format!("{place}.angle"), model, touching)?),
        };
        let slave = SheetCells::new(cells(model, touching.slave).0);
        Ok(FrictionLaw::Varying(Arc::new(VaryingFriction {
            pressure,
            angle,
            slave,
        })))
    }

    fn angle(
        &self,
        law: &AngleLaw,
        place: &str,
        model: &Model,
        touching: &Touching<'_>,
    ) -> Result<AngleDependence, String> {
        let sheet = |name: &str| self.scene.sheets.iter().find(|s| s.name == name);
        let ply = |name: &str| sheet(name).filter(|s| s.kind == SheetKind::Ply);
        let [lower, upper] = touching.parts;
        let found = match (law.of, ply(lower), ply(upper)) {
            (Some(Place::Lower), Some(s), _) | (Some(Place::Upper), _, Some(s)) => s,
            (None, Some(s), None) | (None, None, Some(s)) => s,
            (None, Some(_), Some(_)) => {
                return Err(format!(
                    "{place}.of: {lower} and {upper} both have fibres; expected `lower` or `upper`"
                ));
            }
            _ => {
                return Err(format!(
                    "{place}: the surface meant of {lower} (lower) and {upper} (upper) has no fibres; expected a ply"
                ));
            }
        };
        let first = found.fibre_1.si();
        let direction = match law.family {
            1 => first,
            _ => found
                .fibre_2
                .map_or(first + std::f64::consts::FRAC_PI_2, |a| a.si()),
        };
        let (own, first_cell) = cells(model, &found.name);
        let along = [direction.fixed_cos(), direction.fixed_sin(), 0.0];
        let whose = if found.name == touching.slave {
            Whose::Slave
        } else {
            Whose::Master
        };
        let rows = law.factors.iter().map(|r| [r.angle.si(), r.factor.0]);
        Ok(AngleDependence {
            factors: rows.collect(),
            whose,
            fibres: FibreField::new(own, first_cell, model.x(), along),
        })
    }
}

/// Coefficient under 1 bar, along the fibres or wherever its factor is 1.
pub(crate) fn at_one_bar(law: &FrictionLaw) -> f64 {
    match law {
        // Outside of the regions.
        FrictionLaw::Regional(r) => r.laws.first().map_or(0.0, at_one_bar),
        FrictionLaw::Constant(c) => *c,
        FrictionLaw::Varying(v) => v.pressure.coefficient(1e5),
    }
}

/// A node on a rigid part has no cell of a master, whose fibres it could ask for.
fn without_fibres_of_others(law: FrictionLaw) -> FrictionLaw {
    match law {
        FrictionLaw::Regional(r) => {
            let laws = r.laws.iter().cloned().map(without_fibres_of_others);
            FrictionLaw::Regional(Arc::new(RegionalFriction {
                laws: laws.collect(),
                ..(*r).clone()
            }))
        }
        FrictionLaw::Varying(v) if v.angle.as_ref().is_some_and(|a| a.whose == Whose::Master) => {
            FrictionLaw::Varying(Arc::new(VaryingFriction {
                angle: None,
                ..(*v).clone()
            }))
        }
        law => law,
    }
}

/// Where a scene tells a coefficient of a region.
fn place(sheet: &Sheet, region: &str, partner: &str) -> String {
    format!("sheets.{}.regions.{region}.friction.{partner}", sheet.name)
}

/// The cells of a sheet (model nodes) and the number of the first.
fn cells<'m>(model: &'m Model, sheet: &str) -> (&'m [[u32; 4]], usize) {
    let found = model.sheets().iter().find(|s| s.name == sheet);
    let (c0, c1) = found.map_or((0, 0), |s| s.cell_range);
    (&model.cells()[c0..c1], c0)
}

fn check_coefficient(value: f64, place: &str) -> Result<(), String> {
    if (0.0..=LARGEST_COEFFICIENT).contains(&value) {
        return Ok(());
    }
    Err(format!(
        "{place}: given {value}; expected a coefficient from 0 to {LARGEST_COEFFICIENT}"
    ))
}

/// Whether the first numbers of the rows grow, from at least 0.
fn check_rows(rows: &[f64], place: &str, what: &str) -> Result<(), String> {
    if rows.len() < 2 {
        return Err(format!(
            "{place}: {} given; expected two or more rows with growing {what}",
            if rows.is_empty() { "no row" } else { "one row" }
        ));
    }
    match (1..rows.len()).find(|k| rows[*k] <= rows[k - 1]) {
        None if rows[0] >= 0.0 && rows[rows.len() - 1].is_finite() => Ok(()),
        None => Err(format!(
            "{place}: expected {what} from 0, all of them finite"
        )),
        Some(k) => Err(format!(
            "{place}[{k}]: {} follows {}; expected growing {what}",
            rows[k],
            rows[k - 1]
        )),
    }
}

/// Whether a law is one: coefficients from 0 to the largest, tables in order.
fn check_law(law: &scene::FrictionLaw, place: &str) -> Result<(), String> {
    let mut largest = 0.0f64;
    match (&law.pressure, law.coefficient) {
        (Some(PressureLaw::Table(rows)), None) => {
            let pressures: Vec<f64> = rows.iter().map(|r| r.pressure.si()).collect();
            check_rows(
                &pressures,
                &format!("{place}.pressure.table"),
                "pressures (Pa)",
            )?;
            for (k, row) in rows.iter().enumerate() {
                let at = format!("{place}.pressure.table[{k}].coefficient");
                check_coefficient(row.coefficient.0, &at)?;
                largest = largest.max(row.coefficient.0);
            }
        }
        (Some(PressureLaw::Table(_)), Some(_)) => {
            return Err(format!(
                "{place}.coefficient: given beside a table by pressure, which says it all; remove one of the two"
            ));
        }
        (_, None) => {
            return Err(format!(
                "{place}.coefficient: not given; expected a number from 0 to 2"
            ));
        }
        (power, Some(c)) => {
            check_coefficient(c.0, &format!("{place}.coefficient"))?;
            largest = c.0;
            if let Some(PressureLaw::Power(p)) = power {
                let (reference, exponent) = (p.reference.si(), p.exponent.0);
                if !(reference > 0.0 && reference.is_finite()) {
                    return Err(format!(
                        "{place}.pressure.power.reference: given {reference} Pa; expected a pressure above 0 Pa"
                    ));
                }
                if !(exponent > -1.0 && exponent <= 1.0) {
                    return Err(format!(
                        "{place}.pressure.power.exponent: given {exponent}; expected more than -1 (friction would fall as \
                         pressure grows) and at most 1"
                    ));
                }
            }
        }
    }
    let Some(angle) = &law.angle else {
        return Ok(());
    };
    let angles: Vec<f64> = angle.factors.iter().map(|r| r.angle.si()).collect();
    check_rows(&angles, &format!("{place}.angle.factors"), "angles (rad)")?;
    if angles[angles.len() - 1] > std::f64::consts::FRAC_PI_2 + 1e-9 {
        return Err(format!(
            "{place}.angle.factors: expected angles from 0 to 90 deg: a fibre has no sense"
        ));
    }
    for (k, row) in angle.factors.iter().enumerate() {
        let factor = row.factor.0;
        if !(factor >= 0.0 && factor * largest <= LARGEST_COEFFICIENT) {
            return Err(format!(
                "{place}.angle.factors[{k}].factor: given {factor}; expected 0 or more, and a coefficient of at most \
                 {LARGEST_COEFFICIENT} in all (here {})",
                factor * largest
            ));
        }
    }
    if !(1..=2).contains(&angle.family) {
        return Err(format!(
            "{place}.angle.family: given {}; expected 1 or 2",
            angle.family
        ));
    }
    Ok(())
}
