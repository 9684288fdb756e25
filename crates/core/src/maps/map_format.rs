//! The interface of map files: a format is a name, a writer, a reader, or both. Formats do no IO.

use crate::{
    CompressorMap, ExportError, ImportError, ImportedMap, ImportedTurbine, MapDescription, TurbineMap,
};

/// Maximum size of a map file, bytes: a measured map has some ten thousand.
pub const MAP_FILE_SIZE_LIMIT: usize = 32 << 20;

/// Turns a map into the bytes of a file. The same map gives the same bytes.
pub type WriteMap = fn(&CompressorMap) -> Result<Vec<u8>, ExportError>;

/// Turns a map into the bytes of a picture with numbers in these units.
pub type DrawMap = fn(&CompressorMap, &MapUnits) -> Result<Vec<u8>, ExportError>;

/// Units of a picture of a map; the map itself stays in kg/s and rpm.
#[derive(Debug, Clone, PartialEq)]
pub struct MapUnits {
    /// Unit of flows.
    pub flow: String,
    /// A flow of 1 kg/s in this unit, > 0.
    pub flow_of_one_kg_s: f64,
    /// Unit of speeds.
    pub speed: String,
    /// A speed of 1 rpm in this unit, > 0.
    pub speed_of_one_rpm: f64,
}

impl Default for MapUnits {
    /// kg/s and krpm.
    fn default() -> Self {
        MapUnits {
            flow: "kg/s".to_owned(),
            flow_of_one_kg_s: 1.0,
            speed: "krpm".to_owned(),
            speed_of_one_rpm: 1e-3,
        }
    }
}

/// Parses the bytes of a file into a map; the second argument is the user's description of the file.
///
/// A map without a reference state is rejected: a wrong one shifts speeds by 1.7 % and more, and is not noticed.
pub type ReadMap = fn(&[u8], &MapDescription) -> Result<ImportedMap, ImportError>;

/// Turns a turbine map into the bytes of a file.
pub type WriteTurbine = fn(&TurbineMap) -> Result<Vec<u8>, ExportError>;
/// Reads a turbine map from the bytes of a file.
pub type ReadTurbine = fn(&[u8], &MapDescription) -> Result<ImportedTurbine, ImportError>;

/// The writer and the reader of turbine maps in a format.
#[derive(Debug, Clone, Copy, Default)]
pub struct TurbineFormat {
    /// Turns a map into the bytes of a file.
    pub write: Option<WriteTurbine>,
    /// Parses the bytes of a file.
    pub read: Option<ReadTurbine>,
}

impl TurbineFormat {
    /// A format without turbine maps.
    pub const NONE: TurbineFormat = TurbineFormat { write: None, read: None };
}

/// One file format of maps.
#[derive(Debug, Clone, Copy)]
pub struct MapFormat {
    /// Name as written in campaigns and on the command line.
    pub name: &'static str,
    /// Extension, without the dot, of written files; it may have several parts (`fitted.csv`).
    pub extension: &'static str,
    /// Further extensions of its files.
    pub further_extensions: &'static [&'static str],
    /// A one-line description.
    pub description: &'static str,
    /// Writer, if the format can be written.
    pub write: Option<WriteMap>,
    /// Writer in display units, if the format is a picture.
    pub draw: Option<DrawMap>,
    /// Reader, if the format can be read.
    pub read: Option<ReadMap>,
    /// Writer and reader of turbine maps.
    pub turbine: TurbineFormat,
}

impl MapFormat {
    /// A format that can neither be written nor read: the values of the fields that a format does not set.
    pub const NONE: MapFormat = MapFormat {
        name: "",
        extension: "",
        further_extensions: &[],
        description: "",
        write: None,
        draw: None,
        read: None,
        turbine: TurbineFormat::NONE,
    };

    /// All extensions of its files.
    fn extensions(&self) -> impl Iterator<Item = &'static str> + use<> {
        std::iter::once(self.extension).chain(self.further_extensions.iter().copied())
    }

    /// Writes a file with `map`.
    ///
    /// # Errors
    /// [`ExportError`]: the format is read-only, or it cannot represent this map.
    pub fn write(&self, map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
        match self.write {
            Some(write) => write(map),
            None => Err(ExportError::OnlyRead { format: self.name }),
        }
    }

    /// Writes a map in display units, if the format is a picture.
    ///
    /// # Errors
    /// Those of [`MapFormat::write`].
    pub fn write_in(&self, map: &CompressorMap, units: &MapUnits) -> Result<Vec<u8>, ExportError> {
        self.draw.map_or_else(|| self.write(map), |draw| draw(map, units))
    }

    /// Parses the map of a file; `given` is the user's description of it, or the reference state alone.
    ///
    /// # Errors
    /// [`ImportError`]: the format is write-only, the file is too large, not text, not a map (with its line), or
    /// without a reference state.
    pub fn read(&self, bytes: &[u8], given: impl Into<MapDescription>) -> Result<ImportedMap, ImportError> {
        let read = self.read.ok_or(ImportError::OnlyWritten { format: self.name })?;
        if bytes.len() > MAP_FILE_SIZE_LIMIT {
            return Err(ImportError::TooLarge { bytes: bytes.len(), limit: MAP_FILE_SIZE_LIMIT });
        }
        read(bytes, &given.into())
    }

    /// Writes a file with the map of a turbine.
    ///
    /// # Errors
    /// [`ExportError`]: the format has no turbine maps, or it cannot represent this one.
    pub fn write_turbine(&self, map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
        match self.turbine.write {
            Some(write) => write(map),
            None => Err(ExportError::NoTurbine { format: self.name }),
        }
    }

    /// Parses the map of a turbine.
    ///
    /// # Errors
    /// Those of [`MapFormat::read`].
    pub fn read_turbine(
        &self,
        bytes: &[u8],
        given: impl Into<MapDescription>,
    ) -> Result<ImportedTurbine, ImportError> {
        let read = self.turbine.read.ok_or(ImportError::NoTurbine { format: self.name })?;
        if bytes.len() > MAP_FILE_SIZE_LIMIT {
            return Err(ImportError::TooLarge { bytes: bytes.len(), limit: MAP_FILE_SIZE_LIMIT });
        }
        read(bytes, &given.into())
    }
}

/// The formats of a program.
#[derive(Debug, Clone, Copy)]
pub struct MapFormats(pub &'static [MapFormat]);

impl MapFormats {
    /// All formats, in display order.
    pub fn iter(self) -> impl Iterator<Item = &'static MapFormat> {
        self.0.iter()
    }

    /// The format with this name.
    pub fn find(self, name: &str) -> Option<&'static MapFormat> {
        self.iter().find(|format| format.name == name)
    }

    /// The formats that can be written.
    pub fn written(self) -> impl Iterator<Item = &'static MapFormat> {
        self.iter().filter(|format| format.write.is_some())
    }

    /// The format for writing a file of this name, ignoring case. The longest extension counts:
    /// `map.fitted.csv` is not plain CSV.
    pub fn written_to(self, file_name: &str) -> Option<&'static MapFormat> {
        let file_name = file_name.to_ascii_lowercase();
        let ends =
            |extension: &&str| file_name.strip_suffix(*extension).is_some_and(|before| before.ends_with('.'));
        let fitting = |format: &'static MapFormat| {
            let longest = format.extensions().filter(ends).map(str::len).max()?;
            Some((longest, format))
        };
        let longest = self.written().filter_map(fitting).max_by_key(|(length, _)| *length);
        longest.map(|(_, format)| format)
    }

    /// The format for reading a file with this extension (without the dot).
    pub fn read_from(self, extension: &str) -> Option<&'static MapFormat> {
        let is_read = |format: &&MapFormat| {
            format.read.is_some() && format.extensions().any(|known| known.eq_ignore_ascii_case(extension))
        };
        self.iter().find(is_read)
    }

    /// Every extension of files that can be read.
    pub fn read_extensions(self) -> impl Iterator<Item = &'static str> {
        self.iter().filter(|format| format.read.is_some()).flat_map(MapFormat::extensions)
    }
}
