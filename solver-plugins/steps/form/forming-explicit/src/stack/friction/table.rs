//! By which law two surfaces of a scene rub on each other.

use crate::error::{FormingError, Result};
use crate::stack::friction::check::{check, check_law};
use crate::stack::friction::pairs::{FrictionClass, Pair, pairs, same};
use crate::stack::friction::through::{at_one_bar, least, without_fibres_of_others};
use crate::stack::place::SheetIndex;
use crate::stack::regions::{self, PlacedRegion};
use crate::stack::rigid::RigidName;
use plyflow_fixed::FixedBits;
use plyflow_mechanics::contact::{
    AngleDependence, FibreField, FrictionLaw, Partner, PressureDependence, RegionalFriction,
    SheetCells, VaryingFriction, Whose,
};
use plyflow_mechanics::model::Model;
use plyflow_model::friction::{self as scene, AngleLaw, Coefficient, Place, PressureLaw};
use plyflow_model::nearest::nearest;
use plyflow_model::scene::{Scene, Sheet, SheetKind};
use std::sync::Arc;

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

impl<'a> FrictionTable<'a> {
    /// The table of a scene.
    ///
    /// # Errors
    /// When a pair names surfaces that the scene does not have or that do not touch, or one that another pair names too; when
    /// a law makes no sense.
    pub fn new(scene: &'a Scene) -> Result<Self> {
        let pairs = pairs(scene);
        let table = Self { scene, pairs };
        for k in 0..scene.friction.pairs.len() {
            table.check_pair(k)?;
        }
        for class in FrictionClass::ALL {
            if let (name, Some(given)) = class.given(&scene.friction) {
                check(given, &format!("friction.{name}"))?;
            }
        }
        for sheet in &scene.sheets {
            for region in &sheet.regions {
                for (partner, given) in &region.friction {
                    check(given, &place(sheet, &region.name, partner))?;
                }
            }
        }
        Ok(table)
    }

    fn check_pair(&self, k: usize) -> Result<()> {
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
                return Err(FormingError::Scene(format!(
                    "{place}.between: no surface of scene '{}' is called '{name}'; expected two of: {}{hint}",
                    self.scene.name,
                    names.join(", ")
                )));
            }
        }
        let clash = |s: &&Sheet| RigidName::ALL.iter().any(|part| part.word() == s.name);
        if let Some(sheet) = self.scene.sheets.iter().find(clash) {
            return Err(FormingError::Scene(format!(
                "{place}.between: sheet '{}' has the name of a rigid surface; give the sheet another name",
                sheet.name
            )));
        }
        let between = given.between.each_ref().map(String::as_str);
        if !self.pairs.iter().any(|p| same(&p.parts, between)) {
            let all = self.pairs.iter().map(|p| p.parts.join(" and "));
            return Err(FormingError::Scene(format!(
                "{place}.between: {} and {} do not rub on each other in scene '{}'; expected one of: {}",
                between[0],
                between[1],
                self.scene.name,
                all.collect::<Vec<_>>().join("; ")
            )));
        }
        let before = self.scene.friction.pairs[..k].iter();
        if let Some(j) = before
            .enumerate()
            .find_map(|(j, p)| same(&p.between, between).then_some(j))
        {
            return Err(FormingError::Scene(format!(
                "{place}.between: {} and {} are already the pair of friction.pairs[{j}]; remove one of the two",
                between[0], between[1]
            )));
        }
        check_law(&given.law(), &place)
    }

    /// The law of a contact, and how to make it in a model.
    ///
    /// # Errors
    /// When the scene does not give it, or when whose fibres count is not clear.
    pub fn law(&self, model: &Model, touching: &Touching<'_>) -> Result<FrictionLaw> {
        self.by_region(model, touching, true)
    }

    /// The law of a contact with what its surfaces' regions say. `cells`: whether its nodes touch cells of the other surface.
    fn by_region(
        &self,
        model: &Model,
        touching: &Touching<'_>,
        cells: bool,
    ) -> Result<FrictionLaw> {
        let mut laws = vec![self.everywhere(model, touching)?];
        let [lower, upper] = touching.parts;
        // The surface whose nodes touch comes first; of two between which they do not, the lower one.
        let (own, other) = match touching.slave == upper {
            true => (upper, lower),
            false => (lower, upper),
        };
        let mut of = |name: &str, partner: &str| -> Result<Vec<(PlacedRegion<'a>, u16)>> {
            let Some(sheet) = self.scene.sheets.iter().find(|s| s.name == name) else {
                return Ok(Vec::new());
            };
            let (class, _) = self.class(touching.parts).given(&self.scene.friction);
            let mut found = Vec::new();
            for placed in regions::of_sheet(sheet)? {
                let Some(given) = placed.region.coefficient(partner, class) else {
                    continue;
                };
                let at = place(sheet, &placed.region.name, partner);
                let law = self.given(given, &at, model, touching)?;
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
    fn everywhere(&self, model: &Model, touching: &Touching<'_>) -> Result<FrictionLaw> {
        let f = &self.scene.friction;
        let mut own = f.pairs.iter().enumerate();
        if let Some((k, given)) = own.find(|(_, p)| same(&p.between, touching.parts)) {
            let at = format!("friction.pairs[{k}]");
            return self.make(&given.law(), &at, model, touching);
        }
        let (class, given) = self.class(touching.parts).given(f);
        let at = format!("friction.{class}");
        match given {
            Some(given) => self.given(given, &at, model, touching),
            None => Err(FormingError::Scene(format!(
                "{at}: not given, but in this scene {} and {} touch; expected a coefficient",
                touching.parts[0], touching.parts[1]
            ))),
        }
    }

    /// The law of two sheets that touch past the edges of those between them. Where the scene gives none for the two, that of the pair
    /// of neighbours with the least coefficient, as in [`FrictionTable::through`]. `chain`: the names from the lower to the upper one.
    ///
    /// # Errors
    /// When the scene does not give one of them.
    pub fn past(&self, model: &Model, chain: &[&str], slave: &str) -> Result<FrictionLaw> {
        let parts = [chain[0], chain[chain.len() - 1]];
        let f = &self.scene.friction;
        let named = f.pairs.iter().any(|p| same(&p.between, parts));
        if named || self.class(parts).given(f).1.is_some() {
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
    pub fn through(&self, model: &Model, parts: &[&str], sheet: &str) -> Result<FrictionLaw> {
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
            return Ok(least(model, sheet, &laws));
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
    fn class(&self, parts: [&str; 2]) -> FrictionClass {
        if let Some(pair) = self.pairs.iter().find(|p| same(&p.parts, parts)) {
            return pair.class;
        }
        let sheet = |name: &str| self.scene.sheets.iter().find(|s| s.name == name);
        match parts.map(|name| sheet(name).map(|s| s.kind)) {
            [Some(sheet), other] | [other, Some(sheet)] => FrictionClass::of(sheet, other),
            [None, None] => FrictionClass::ToolDiaphragm,
        }
    }

    /// What a scene gives at a place, as a law of the model.
    fn given(
        &self,
        given: &Coefficient,
        place: &str,
        model: &Model,
        touching: &Touching<'_>,
    ) -> Result<FrictionLaw> {
        match given {
            Coefficient::Constant(n) => Ok(n.0.into()),
            Coefficient::Law(law) => self.make(law, place, model, touching),
        }
    }

    fn make(
        &self,
        law: &scene::FrictionLaw,
        place: &str,
        model: &Model,
        touching: &Touching<'_>,
    ) -> Result<FrictionLaw> {
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
    ) -> Result<AngleDependence> {
        let sheet = |name: &str| self.scene.sheets.iter().find(|s| s.name == name);
        let ply = |name: &str| sheet(name).filter(|s| s.kind == SheetKind::Ply);
        let [lower, upper] = touching.parts;
        let found = match (law.of, ply(lower), ply(upper)) {
            (Some(Place::Lower), Some(s), _) | (Some(Place::Upper), _, Some(s)) => s,
            (None, Some(s), None) | (None, None, Some(s)) => s,
            (None, Some(_), Some(_)) => {
                return Err(FormingError::Scene(format!(
                    "{place}.of: {lower} and {upper} both have fibres; expected `lower` or `upper`"
                )));
            }
            _ => {
                return Err(FormingError::Scene(format!(
                    "{place}: the surface meant of {lower} (lower) and {upper} (upper) has no fibres; expected a ply"
                )));
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

/// Where a scene tells a coefficient of a region.
fn place(sheet: &Sheet, region: &str, partner: &str) -> String {
    format!("sheets.{}.regions.{region}.friction.{partner}", sheet.name)
}

/// The cells of a sheet (model nodes) and the number of the first.
fn cells<'m>(model: &'m Model, sheet: &str) -> (&'m [[u32; 4]], usize) {
    SheetIndex::named(model, sheet)
        .map_or((&[], 0), |s| (s.cells(model), s.cell_range(model).start))
}
