//! By which law two surfaces of a scene rub on each other.

use crate::error::{FormingError, Result};
use crate::stack::friction::through::{at_one_bar, least, without_fibres_of_others};
use crate::stack::place::SheetIndex;
use crate::stack::regions::{self, PlacedRegion};
use plyflow_fixed::FixedBits;
use plyflow_mechanics::contact::{
    AngleDependence, FibreField, FrictionLaw, LARGEST_COEFFICIENT, Partner, PressureDependence,
    RegionalFriction, SheetCells, VaryingFriction, Whose,
};
use plyflow_mechanics::model::Model;
use plyflow_model::friction::{self as scene, AngleLaw, Coefficient, PressureLaw};
use plyflow_model::rules::friction::{LARGEST, missing, of_class, whose};
use plyflow_model::rules::surfaces::{Class, same_pair};
use plyflow_model::scene::{Scene, Sheet, SheetKind};
use std::sync::Arc;

// Contact cuts off what rules refuse.
const _: () = assert!(LARGEST_COEFFICIENT == LARGEST);

/// The friction of a scene that keeps its rules.
pub struct FrictionTable<'a> {
    /// The scene.
    pub scene: &'a Scene,
}

/// The contact for which a law is asked.
pub struct Touching<'a> {
    /// Names of the two surfaces, the lower one first.
    pub parts: [&'a str; 2],
    /// Name of the sheet whose nodes touch.
    pub slave: &'a str,
}

impl<'a> FrictionTable<'a> {
    /// The law of a contact, and how to make it in a model. Where the scene gives none for two that have others between them (they meet past
    /// those, or in a zone that those do not reach), as in [`FrictionTable::through`].
    ///
    /// # Errors
    /// When the scene does not give it, or when it is not clear whose fibres count (which its rules forbid).
    pub fn law(&self, model: &Model, touching: &Touching<'_>) -> Result<FrictionLaw> {
        match self.is_given(touching.parts) {
            true => self.by_region(model, touching, true),
            false => self.through(model, &touching.parts, touching.slave),
        }
    }

    /// Whether the scene gives a law for two surfaces, as a pair or as a class.
    fn is_given(&self, parts: [&str; 2]) -> bool {
        let f = &self.scene.friction;
        f.pairs.iter().any(|p| same_pair(p.names(), parts))
            || of_class(f, self.class(parts)).is_some()
    }

    /// A chain of surfaces, lower ones first, with those between two of them for which the scene gives no law.
    fn told<'s>(&'s self, chain: &[&'s str]) -> Vec<&'s str> {
        let mut all = Vec::new();
        for [lower, upper] in chain.windows(2).map(|two| [two[0], two[1]]) {
            all.push(lower);
            if !self.is_given([lower, upper]) {
                let sheets = || self.scene.sheets.iter().map(|s| s.name.as_str());
                let first = sheets().position(|s| s == lower).map_or(0, |k| k + 1);
                all.extend(sheets().skip(first).take_while(|s| *s != upper));
            }
        }
        all.extend(chain.last());
        all
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
            let Some(sheet) = self.sheet(name) else {
                return Ok(Vec::new());
            };
            let class = self.class(touching.parts).word();
            let mut found = Vec::new();
            for placed in regions::of_sheet(sheet)? {
                let Some(given) = placed.region.coefficient(partner, class) else {
                    continue;
                };
                let law = self.given(given, model, touching)?;
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
        let mut own = f.pairs.iter();
        if let Some(given) = own.find(|p| same_pair(p.names(), touching.parts)) {
            return self.make(&given.law(), model, touching);
        }
        let class = self.class(touching.parts);
        let given = of_class(f, class).ok_or_else(|| missing(class, touching.parts))?;
        self.given(given, model, touching)
    }

    /// The law of two sheets that touch past the edges of those between them. Where the scene gives none for the two, that of the pair
    /// of neighbours with the least coefficient, as in [`FrictionTable::through`]. `chain`: the names from the lower to the upper one.
    ///
    /// # Errors
    /// When the scene does not give one of them.
    pub fn past(&self, model: &Model, chain: &[&str], slave: &str) -> Result<FrictionLaw> {
        let parts = [chain[0], chain[chain.len() - 1]];
        if self.is_given(parts) {
            self.by_region(model, &Touching { parts, slave }, true)
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
        let chain = self.told(parts);
        for two in chain.windows(2) {
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

    /// Class of two surfaces.
    fn class(&self, parts: [&str; 2]) -> Class {
        match parts.map(|name| self.sheet(name).map(|s| s.kind)) {
            [Some(sheet), other] | [other, Some(sheet)] => Class::of(sheet, other),
            [None, None] => Class::ToolDiaphragm,
        }
    }

    fn sheet(&self, name: &str) -> Option<&'a Sheet> {
        self.scene.sheets.iter().find(|s| s.name == name)
    }

    /// What a scene gives, as a law of the model.
    fn given(
        &self,
        given: &Coefficient,
        model: &Model,
        touching: &Touching<'_>,
    ) -> Result<FrictionLaw> {
        match given {
            Coefficient::Constant(n) => Ok(n.0.into()),
            Coefficient::Law(law) => self.make(law, model, touching),
        }
    }

    fn make(
        &self,
        law: &scene::FrictionLaw,
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
            Some(a) => Some(self.angle(a, model, touching)?),
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
        model: &Model,
        touching: &Touching<'_>,
    ) -> Result<AngleDependence> {
        let plies = touching.parts.map(|name| {
            let sheet = self.sheet(name);
            sheet.filter(|s| s.kind == SheetKind::Ply)
        });
        let found = whose(law, touching.parts, plies)?;
        let family = usize::from(law.family != 1);
        let (own, first_cell) = cells(model, &found.name);
        let laid = found
            .laid()
            .map_err(|e| FormingError::Scene(format!("fibre_1 of sheet '{}': {e}", found.name)))?;
        // The model lies flat yet.
        let along = |cell: usize| {
            let direction = laid.in_cell(&own[cell].map(|n| model.x()[n as usize]))[family];
            [direction.fixed_cos(), direction.fixed_sin(), 0.0]
        };
        let whose = if found.name == touching.slave {
            Whose::Slave
        } else {
            Whose::Master
        };
        let rows = law.factors.iter().map(|r| [r.angle.si(), r.factor.0]);
        Ok(AngleDependence {
            factors: rows.collect(),
            whose,
            fibres: FibreField::steered(own, first_cell, model.x(), along),
        })
    }
}

/// The cells of a sheet (model nodes) and the number of the first.
fn cells<'m>(model: &'m Model, sheet: &str) -> (&'m [[u32; 4]], usize) {
    SheetIndex::named(model, sheet)
        .map_or((&[], 0), |s| (s.cells(model), s.cell_range(model).start))
}
