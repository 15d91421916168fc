//! Object code, laid down in memory so that it can run.
//!
//! This does what a linker does, for the one case that there is: an object of few functions for x86-64, position independent, which reads its
//! own constants and calls the functions of [`crate::functions`]. Everything else is refused by name.

use crate::functions;
use memmap2::{Mmap, MmapMut};
use object::read::elf::{ElfFile64, ElfSection64};
use object::{
    Object, ObjectSection, ObjectSymbol, Relocation, RelocationKind, RelocationTarget,
    SectionIndex, SectionKind, SymbolIndex,
};
use std::collections::BTreeMap;

/// Memory that can be run and not be written to.
pub struct Code {
    memory: Mmap,
    entry: usize,
}

/// `jmp *0(%rip)`, with the address behind it.
const JUMP: [u8; 6] = [0xff, 0x25, 0, 0, 0, 0];
const STUB: usize = 16;

impl Code {
    /// Lays down the sections of an object, and finds the function `entry` in it.
    ///
    /// # Errors
    /// The object needs what a law has not: says what.
    pub fn load(object: &[u8], entry: &str) -> Result<Self, String> {
        let file: ElfFile64<'_> = ElfFile64::parse(object).map_err(|e| format!("object: {e}"))?;
        if file.architecture() != object::Architecture::X86_64 {
            return Err(format!("the code is for {:?}", file.architecture()));
        }
        let layout = Layout::of(&file)?;
        let memory = MmapMut::map_anon(layout.size.max(1));
        let mut memory = memory.map_err(|e| format!("no memory for the code: {e}"))?;
        for (index, at) in &layout.sections {
            let section = file
                .section_by_index(SectionIndex(*index))
                .map_err(|e| e.to_string())?;
            let bytes = section.data().map_err(|e| e.to_string())?;
            memory[*at..at + bytes.len()].copy_from_slice(bytes);
            for (offset, relocation) in section.relocations() {
                let place = at + offset as usize;
                let begins = memory.as_ptr() as i64;
                let value = layout.value(&file, &relocation, place, begins)?;
                let bytes = memory.get_mut(place..place + value.len());
                let bytes = bytes.ok_or("a relocation lies outside of its section")?;
                bytes.copy_from_slice(&value);
            }
        }
        for (address, at) in layout.functions.values() {
            memory[*at..at + JUMP.len()].copy_from_slice(&JUMP);
            memory[at + JUMP.len()..at + JUMP.len() + 8].copy_from_slice(&address.to_le_bytes());
        }
        let found = file.symbols().find(|s| s.name() == Ok(entry));
        let found = found.and_then(|s| layout.place(&file, s.index()).ok());
        let entry = found.ok_or_else(|| format!("there is no function {entry} in the code"))?;
        let memory = memory.make_exec();
        let memory = memory.map_err(|e| format!("the system does not let code be run: {e}"))?;
        Ok(Self { memory, entry })
    }

    /// Where the function begins. It is there as long as this is.
    pub fn entry(&self) -> *const u8 {
        &raw const self.memory[self.entry]
    }
}

/// Where everything lies, from the beginning of the memory.
struct Layout {
    /// By the number of a section.
    sections: BTreeMap<usize, usize>,
    /// Functions from outside: their address, and where the jump to it lies, which is near enough for a call.
    functions: BTreeMap<String, (usize, usize)>,
    size: usize,
}

impl Layout {
    fn of(file: &ElfFile64<'_>) -> Result<Self, String> {
        let mut new = Self {
            sections: BTreeMap::new(),
            functions: BTreeMap::new(),
            size: 0,
        };
        for section in file.sections() {
            let name = section.name().unwrap_or("?");
            match section.kind() {
                // How to unwind: nothing does, as nothing is thrown.
                _ if name == ".eh_frame" => {}
                // Written to by the loader alone: it holds addresses.
                SectionKind::Data if name.starts_with(".data.rel.ro") => new.add(&section),
                SectionKind::Text
                | SectionKind::ReadOnlyData
                | SectionKind::ReadOnlyString
                | SectionKind::ReadOnlyDataWithRel => new.add(&section),
                SectionKind::Data | SectionKind::UninitializedData | SectionKind::Tls
                    if section.size() > 0 =>
                {
                    return Err(format!("the code has variables of its own ({name})"));
                }
                _ => {}
            }
        }
        for symbol in file.symbols().filter(|s| s.is_undefined()) {
            let name = symbol.name().unwrap_or("?");
            if name.is_empty() {
                continue;
            }
            let address = functions::address(name)
                .ok_or_else(|| format!("the code calls {name}, which is not there for a law"))?;
            let at = new.size.next_multiple_of(STUB);
            new.functions.insert(name.to_owned(), (address, at));
            new.size = at + STUB;
        }
        Ok(new)
    }

    fn add(&mut self, section: &ElfSection64<'_, '_>) {
        // Memory begins at a page, so that larger alignments need more than is given here; LLVM asks for 64 bytes at most.
        let at = self
            .size
            .next_multiple_of(section.align().clamp(1, 4096) as usize);
        self.sections.insert(section.index().0, at);
        self.size = at + section.size() as usize;
    }

    /// Where a symbol lies.
    fn place(&self, file: &ElfFile64<'_>, index: SymbolIndex) -> Result<usize, String> {
        let symbol = file.symbol_by_index(index).map_err(|e| e.to_string())?;
        let name = symbol.name().unwrap_or("?");
        if let Some((_, at)) = self.functions.get(name) {
            return Ok(*at);
        }
        let section = symbol.section_index().and_then(|i| self.sections.get(&i.0));
        let section = section.ok_or_else(|| format!("{name} lies in no section that is kept"))?;
        Ok(section + symbol.address() as usize)
    }

    /// What a relocation at `place` asks to be written there: how far its target is from it, or where the target is in a memory that begins at
    /// `begins`, which is how tables of constants are found.
    fn value(
        &self,
        file: &ElfFile64<'_>,
        relocation: &Relocation,
        place: usize,
        begins: i64,
    ) -> Result<Vec<u8>, String> {
        let RelocationTarget::Symbol(target) = relocation.target() else {
            return Err("a relocation has no symbol".into());
        };
        let target = || {
            let at = self.place(file, target)? as i64;
            Ok::<i64, String>(at + relocation.addend())
        };
        match (relocation.kind(), relocation.size()) {
            _ if relocation.has_implicit_addend() => Err("a relocation has no addend".into()),
            (RelocationKind::Relative | RelocationKind::PltRelative, 32) => {
                let distance = i32::try_from(target()? - place as i64);
                let distance = distance.map_err(|_| "the code is larger than 2 GiB")?;
                Ok(distance.to_le_bytes().to_vec())
            }
            (RelocationKind::Absolute, 64) => Ok((begins + target()?).to_le_bytes().to_vec()),
            _ => Err(format!(
                "a relocation of kind {:?} is not known here",
                relocation.flags()
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use object::write::{self, StandardSection, StandardSegment, SymbolSection};
    use object::{RelocationEncoding, RelocationFlags, SymbolFlags, SymbolKind, SymbolScope};

    /// An object whose function reads 27 from a section of constants, calls a function `called` with it, and returns what that gives.
    fn cube_root_of_27(called: &str, kind: RelocationKind) -> write::Object<'static> {
        let mut made = write::Object::new(
            object::BinaryFormat::Elf,
            object::Architecture::X86_64,
            object::Endianness::Little,
        );
        let text = made.section_id(StandardSection::Text);
        let data = made.section_id(StandardSection::ReadOnlyData);
        // sub rsp, 8; movsd xmm0, [rip + ..]; call ..; add rsp, 8; ret
        let code = [
            0x48, 0x83, 0xec, 0x08, 0xf2, 0x0f, 0x10, 0x05, 0, 0, 0, 0, 0xe8, 0, 0, 0, 0, 0x48,
            0x83, 0xc4, 0x08, 0xc3,
        ];
        let symbol = |name: &str, section, kind| write::Symbol {
            name: name.into(),
            value: 0,
            size: 0,
            kind,
            scope: SymbolScope::Linkage,
            weak: false,
            section,
            flags: SymbolFlags::None,
        };
        let function = made.add_symbol(symbol("entry", SymbolSection::Undefined, SymbolKind::Text));
        made.add_symbol_data(function, text, &code, 16);
        let constant = made.section_symbol(data);
        made.append_section_data(data, &27f64.to_le_bytes(), 8);
        let outside = made.add_symbol(symbol(called, SymbolSection::Undefined, SymbolKind::Text));
        let relocations = [(8, constant, RelocationKind::Relative), (13, outside, kind)];
        for (offset, symbol, kind) in relocations {
            let relocation = write::Relocation {
                offset,
                symbol,
                addend: -4,
                flags: RelocationFlags::Generic {
                    kind,
                    encoding: RelocationEncoding::Generic,
                    size: 32,
                },
            };
            made.add_relocation(text, relocation).unwrap();
        }
        made
    }

    fn load(made: &write::Object<'_>) -> Result<Code, String> {
        Code::load(&made.write().unwrap(), "entry")
    }

    #[test]
    fn code_reads_its_constants_and_calls_functions() {
        let code = load(&cube_root_of_27("cbrt", RelocationKind::PltRelative)).unwrap();
        // SAFETY: the bytes above are a function that takes nothing and returns a double.
        let entry: extern "C" fn() -> f64 = unsafe { std::mem::transmute(code.entry()) };
        assert_eq!(entry(), 3.0);
    }

    #[test]
    fn tables_hold_the_addresses_of_constants() {
        // The entry is read as data here: eight bytes in a section of their own that point to the constant behind the code.
        let mut made = cube_root_of_27("cbrt", RelocationKind::PltRelative);
        let segment = made.segment_name(StandardSegment::Data).to_vec();
        let table = made.add_section(segment, b".data.rel.ro".to_vec(), SectionKind::Data);
        made.append_section_data(table, &[0; 8], 8);
        let data = made.section_id(StandardSection::ReadOnlyData);
        let constant = made.section_symbol(data);
        let relocation = write::Relocation {
            offset: 0,
            symbol: constant,
            addend: 0,
            flags: RelocationFlags::Generic {
                kind: RelocationKind::Absolute,
                encoding: RelocationEncoding::Generic,
                size: 64,
            },
        };
        made.add_relocation(table, relocation).unwrap();
        let code = load(&made).unwrap();
        let begins = code.memory.as_ptr() as usize;
        let words = code.memory.chunks_exact(8);
        let words: Vec<u64> = words
            .map(|w| u64::from_le_bytes(w.try_into().unwrap()))
            .collect();
        let inside =
            |word: &&u64| (begins..begins + code.memory.len()).contains(&(**word as usize));
        let found: Vec<&u64> = words.iter().filter(inside).collect();
        assert_eq!(found.len(), 1, "{words:x?}");
        let at = *found[0] as usize - begins;
        assert_eq!(code.memory[at..at + 8], 27f64.to_le_bytes());
    }

    #[test]
    fn what_a_law_has_not_is_refused_by_name() {
        let why = |made: &write::Object<'_>| load(made).err().unwrap();
        let unknown = cube_root_of_27("PyErr_SetNone", RelocationKind::PltRelative);
        assert_eq!(
            why(&unknown),
            "the code calls PyErr_SetNone, which is not there for a law"
        );
        let table = cube_root_of_27("cbrt", RelocationKind::GotRelative);
        assert!(why(&table).contains("is not known here"), "{}", why(&table));
        let mut variable = cube_root_of_27("cbrt", RelocationKind::PltRelative);
        let segment = variable.segment_name(StandardSegment::Data).to_vec();
        let data = variable.add_section(segment, b".data.mine".to_vec(), SectionKind::Data);
        variable.append_section_data(data, &[1; 8], 8);
        assert_eq!(
            why(&variable),
            "the code has variables of its own (.data.mine)"
        );
        let why = Code::load(b"no object", "entry").err().unwrap();
        assert!(why.starts_with("object:"), "{why}");
    }

    #[test]
    fn an_object_without_the_function_is_refused() {
        let made = cube_root_of_27("cbrt", RelocationKind::PltRelative);
        let why = Code::load(&made.write().unwrap(), "other").err().unwrap();
        assert_eq!(why, "there is no function other in the code");
    }
}
