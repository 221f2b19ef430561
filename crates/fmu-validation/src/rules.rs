//! The published rules, in one table.
//!
//! `docs/validation.md` shows the same table; a test compares them.

/// The consequence of a broken rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The FMU violates the standard, or cannot be used.
    Error,
    /// The FMU is allowed, but some importers fail on it.
    Warning,
    /// Nothing is wrong, but one of the named [`importers`](super::importers) rejects the FMU.
    Note,
}

impl Severity {
    /// `error`, `warning` or `note`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
            Self::Note => "note",
        }
    }
}

/// A rule for FMUs.
#[derive(Debug)]
pub struct Rule {
    /// The rule's permanent identifier.
    pub id: &'static str,
    /// The consequence of breaking the rule.
    pub severity: Severity,
    /// The rule's source: sections of FMI 2.0.5 and FMI 3.0.2, and `schema` for requirements of the schemas.
    pub source: &'static str,
    /// The rule's text.
    pub text: &'static str,
    /// The remedy for a broken FMU.
    pub remedy: &'static str,
}

macro_rules! rules {
    ($($name:ident: $severity:ident $id:literal ($source:literal) $text:literal => $remedy:literal;)*) => {
        $(
            #[doc = $text]
            pub static $name: Rule = Rule {
                id: $id, severity: Severity::$severity, source: $source, text: $text, remedy: $remedy,
            };
        )*

        /// All rules, in the order they are checked.
        pub static ALL: &[&Rule] = &[$(&$name),*];
    };
}

rules! {
    // The archive.
    ARCHIVE_FORMAT: Error "archive-format" ("2.0.5: 2.3; 3.0.2: 2.5")
        "An FMU is a ZIP archive." => "Pack the files again with a ZIP tool.";
    ARCHIVE_NAME: Warning "archive-name" ("2.0.5: 2.3; 3.0.2: 2.5")
        "The file's name ends in `.fmu`." => "Rename the file.";
    ARCHIVE_DUPLICATE: Error "archive-duplicate" ("portability")
        "Paths are unique, ignoring case." => "Remove or rename one of them.";
    ARCHIVE_FILE_AND_FOLDER: Error "archive-file-and-folder" ("ZIP")
        "No entry lies below a file, ignoring case." => "Remove or rename one of them: no system can unpack both.";
    ARCHIVE_BACKSLASH: Error "archive-backslash" ("2.0.5: 2.3; 3.0.2: 2.5")
        "Paths use `/`, not backslashes." => "Pack the files again with a tool that writes `/`.";
    ARCHIVE_PATH: Error "archive-path" ("security")
        "No entry escapes the extraction folder." => "Pack the files with relative paths and without `..`.";
    ARCHIVE_LINK: Error "archive-link" ("2.0.5: 2.3; 3.0.2: 2.5")
        "The archive has no links." => "Replace the link with its target.";
    ARCHIVE_ENCRYPTION: Error "archive-encryption" ("2.0.5: 2.3; 3.0.2: 2.5")
        "No entry is encrypted." => "Pack the files again without a password.";
    ARCHIVE_COMPRESSION: Error "archive-compression" ("2.0.5: 2.3; 3.0.2: 2.5")
        "Entries are stored or deflated." => "Pack the files again with the method deflate.";
    ARCHIVE_DAMAGED: Error "archive-damaged" ("ZIP")
        "Each entry unpacks to its stated size and checksum." => "The file was damaged in transfer: get it again, or pack it again.";
    ARCHIVE_STRAY: Warning "archive-stray" ("2.0.5: 2.3; 3.0.2: 2.5.1")
        "The top level holds only the standard's files and folders." => "Move the file into `resources` or `extra`, or remove it.";
    LIMIT: Error "limit" ("safety")
        "The FMU is within the size limits: 1 GiB unpacked; descriptions of 64 MiB, two million elements nested 100 deep, 100 attributes each, of 10 kB unless lists or prose, and 1000 namespaces." => "Split the FMU, or leave large data out of it.";
    DESCRIPTION_MISSING: Error "description-missing" ("2.0.5: 2.3; 3.0.2: 2.5.1")
        "`modelDescription.xml` is at the top level." => "Pack the folder's contents, not the folder itself.";

    // XML and its schema.
    XML_ENCODING: Error "xml-encoding" ("2.0.5: 2.2; 3.0.2: 2.4")
        "XML files are UTF-8, and declare no other encoding." => "Save the file in UTF-8 with `<?xml version=\"1.0\" encoding=\"UTF-8\"?>` as its first line.";
    XML_DOCTYPE: Error "xml-doctype" ("security")
        "XML files have no document type definition, whose entities can expand without bound." => "Remove the `<!DOCTYPE …>`.";
    XML_SYNTAX: Error "xml-syntax" ("XML 1.0")
        "XML files are well-formed." => "Correct the XML at this line.";
    VERSION: Error "version" ("2.0.5: 2.2.1; 3.0.2: 2.4.1")
        "The root is `fmiModelDescription` with `fmiVersion` 2.0 or 3.x." => "Set `fmiVersion` to the version that the FMU implements.";
    SCHEMA_ELEMENT: Error "schema-element" ("schema")
        "Elements and their order follow the schema; no required one is missing." => "Add, move or remove the element.";
    SCHEMA_ATTRIBUTE: Error "schema-attribute" ("schema")
        "Attributes follow the schema; no required one is missing." => "Add or remove the attribute.";
    SCHEMA_VALUE: Error "schema-value" ("schema")
        "Attribute values have the schema's types." => "Correct the value.";

    // The FMU as a whole.
    INTERFACE: Error "interface" ("2.0.5: 2.2.1; 3.0.2: 2.4.1")
        "An FMU declares at least one interface (Model Exchange, Co-Simulation, Scheduled Execution), each once." => "Declare each interface that the FMU implements once.";
    MODEL_IDENTIFIER: Error "model-identifier" ("2.0.5: 3.3.1, 4.3.1; 3.0.2: 2.4.2")
        "A model identifier is a C identifier: letters, digits and `_`, no leading digit." => "Rename the model, its libraries and functions.";
    GUID: Error "guid" ("2.0.5: 2.2.1; 3.0.2: 2.4.1")
        "The GUID (instantiation token) is not empty." => "Generate one, in the description and the library.";
    EVENT_INDICATOR_COUNT: Warning "event-indicator-count" ("2.0.5: 2.2.1")
        "A Model Exchange FMU states `numberOfEventIndicators`." => "Add the attribute, with 0 if there are no event indicators.";
    GENERATION_DATE: Warning "generation-date" ("2.0.5: 2.2.1; 3.0.2: 2.4.1")
        "`generationDateAndTime` is in UTC, as `2009-12-08T14:33:22Z`." => "Write the time in UTC, without fractions of a second, with a `Z`.";
    DEFAULT_EXPERIMENT: Error "default-experiment" ("2.0.5: 2.2.5; 3.0.2: 2.4.6")
        "The default experiment is valid: finite times, stop not before start, positive step size and tolerance." => "Correct the attribute, or leave it out.";
    CAPABILITY: Error "capability" ("2.0.5: 3.3.1, 4.3.1; 3.0.2: 2.4.2")
        "`canSerializeFMUstate` requires `canGetAndSetFMUstate`." => "Declare both, or neither.";
    LOG_CATEGORY: Error "log-category" ("2.0.5: 2.2.4; 3.0.2: 2.4.5")
        "Log category names are unique." => "Remove or rename one of them.";

    // Units and types.
    UNIT_NAME: Error "unit-name" ("2.0.5: 2.2.2; 3.0.2: 2.4.3")
        "Unit names are unique, as are the display units of each unit." => "Remove or rename one of them.";
    UNIT_FACTOR: Error "unit-factor" ("2.0.5: 2.2.2; 3.0.2: 2.4.3")
        "Unit factors are finite and nonzero, offsets finite; `inverse` has no offset." => "Correct the conversion.";
    UNIT_DEFINED: Error "unit-defined" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "Units of variables and types are in `UnitDefinitions`." => "Add the unit to `UnitDefinitions`.";
    DISPLAY_UNIT: Error "display-unit" ("2.0.5: 2.2.3; 3.0.2: 2.4.4")
        "A display unit is defined under its unit." => "Add a `DisplayUnit` to the unit's definition.";
    TYPE_NAME: Error "type-name" ("2.0.5: 2.2.3; 3.0.2: 2.4.4")
        "Type names are unique and differ from variable names." => "Rename the type.";
    TYPE_DEFINED: Error "type-defined" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "A variable's declared type is defined, and of the same kind." => "Add the type to `TypeDefinitions`, or name another one.";
    ENUMERATION_ITEM: Error "enumeration-item" ("2.0.5: 2.2.3; 3.0.2: 2.4.4")
        "An enumeration's item names and values are unique." => "Remove or change one of them.";

    // Variables.
    VARIABLE_NAME: Error "variable-name" ("2.0.5: 2.2.7; 3.0.2: 2.4.7")
        "Variable and alias names are unique and not empty." => "Rename one of the variables.";
    NAME_SYNTAX: Error "name-syntax" ("2.0.5: 2.2.9; 3.0.2: 2.4.7.5.1")
        "Names follow the `variableNamingConvention`: the `structured` grammar, or no tabs and line breaks." => "Rename the variable, quote the part with `'…'`, or use `variableNamingConvention=\"flat\"`.";
    VALUE_REFERENCE: Error "value-reference" ("3.0.2: 2.4.7.4")
        "Value references are unique." => "Number the variables differently, or declare the second one as `Alias`.";
    ALIAS: Error "alias" ("2.0.5: 2.2.7")
        "Among variables sharing type and value reference, at most one has a start value; all or none are constant, with equal values; units match." => "Give the variable a unique value reference.";
    CAUSALITY: Error "causality" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.4")
        "The standard allows this combination of causality and variability." => "See the table of combinations in the standard.";
    INITIAL: Error "initial" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "`initial` fits the causality and variability." => "Leave `initial` out, or see the table of its values in the standard.";
    CONTINUOUS_TYPE: Error "continuous-type" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.4")
        "Only floating-point variables are continuous (the default in FMI 2)." => "Declare `variability=\"discrete\"`.";
    INDEPENDENT: Error "independent" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.4")
        "Exactly one variable is independent (FMI 2: at most one), and floating-point." => "Declare only time with `causality=\"independent\"`.";
    START_MISSING: Error "start-missing" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "Inputs, parameters, constants, and variables with `initial` `exact` or `approx` have a start value." => "Add the start value that the library uses.";
    START_FORBIDDEN: Error "start-forbidden" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "Calculated and independent variables have no start value." => "Remove the start value, or declare `initial=\"exact\"` or `\"approx\"`.";
    START_RANGE: Error "start-range" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "A start value is within `min` and `max`, and is an item of its enumeration." => "Correct the start value, or the range.";
    START_COUNT: Error "start-count" ("3.0.2: 2.4.7.5")
        "An array has one start value or one per element; a scalar has one." => "Give one value, or one for each element.";
    RANGE: Error "range" ("2.0.5: 2.2.3; 3.0.2: 2.4.4")
        "`min` does not exceed `max`." => "Exchange or correct them.";
    NOMINAL: Warning "nominal" ("2.0.5: 2.2.3; 3.0.2: 2.4.4")
        "Nominal values, which scale tolerances, are not 0." => "Give the order of magnitude, or leave it out.";
    FINITE: Error "finite" ("2.0.5: 2.2")
        "Variable values are neither infinite nor NaN." => "Leave the attribute out, or give a number.";
    STATE_NOMINAL: Error "state-nominal" ("2.0.5: 3.2.2; 3.0.2: 3.2.1")
        "In Model Exchange FMUs, nominal values of continuous states are positive." => "Give the order of magnitude, or leave it out for the default of 1.";
    DERIVATIVE: Error "derivative" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "`derivative` refers to another variable; both are continuous and floating-point." => "Refer to the variable whose derivative this is.";
    REINIT: Error "reinit" ("2.0.5: 2.2.7; 3.0.2: 2.4.7.5")
        "Only continuous states of Model Exchange FMUs have `reinit`." => "Remove the attribute.";
    DIMENSION: Error "dimension" ("3.0.2: 2.4.7.2")
        "A dimension has either a positive `start`, or the value reference of a `UInt64` constant or structural parameter with positive start; structural parameters have no dimensions." => "Correct the dimension.";
    CLOCK: Error "clock" ("3.0.2: 2.4.4, 2.4.7.4")
        "A Clock is a discrete input, output or local; only inputs have intervals; intervals and resolutions are positive, shifts nonnegative." => "Correct the Clock's attributes.";
    CLOCKED: Error "clocked" ("3.0.2: 2.4.7.4")
        "`clocks` refers to Clocks; clocked variables are discrete or tunable." => "Refer to variables of type Clock, and declare `variability=\"discrete\"`.";
    PREVIOUS: Error "previous" ("3.0.2: 2.4.7.4")
        "Only clocked discrete variables have `previous`; it refers to another discrete variable of the same type that is neither an input nor the previous value of a third." => "Refer to the variable with the previous value.";
    INTERMEDIATE_UPDATE: Error "intermediate-update" ("3.0.2: 2.4.7.4")
        "Only continuous variables have `intermediateUpdate`." => "Remove the attribute.";

    // The model structure.
    STRUCTURE_REFERENCE: Error "structure-reference" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "Model structure entries and dependencies refer to variables." => "Correct the index (FMI 2) or value reference (FMI 3).";
    STRUCTURE_DUPLICATE: Error "structure-duplicate" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "No variable repeats in a model structure list or an entry's dependencies." => "Remove one of them.";
    STRUCTURE_ORDER: Error "structure-order" ("2.0.5: 2.2.8")
        "Initial unknowns are in variable order." => "Sort the entries.";
    DEPENDENCY_ORDER: Warning "dependency-order" ("2.0.5: 2.2.8")
        "Dependencies are in variable order." => "Sort them.";
    DEPENDENCY_KIND: Error "dependency-kind" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "`dependenciesKind` requires `dependencies`, with as many items." => "Give a kind for each dependency, or leave `dependenciesKind` out.";
    DEPENDENCY_KIND_USE: Warning "dependency-kind-use" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "Only floating-point unknowns have kinds other than `dependent`; initial unknowns have no `fixed`, `tunable` or `discrete`." => "Use `dependent`.";
    DEPENDENCY_KNOWN: Warning "dependency-known" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "Dependencies are knowns: inputs, states, parameters, the independent variable, and initially `exact` variables." => "Depend on what the variable itself depends on.";
    OUTPUTS: Error "outputs" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "The output list holds exactly the variables with `causality=\"output\"`." => "Add the output, or remove the entry.";
    DERIVATIVES: Error "derivatives" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "The derivative list holds variables with the attribute `derivative`; their states are locals or outputs, one per entry." => "Add the attribute `derivative` to the variable, or remove the entry.";
    INITIAL_UNKNOWNS: Error "initial-unknowns" ("2.0.5: 2.2.8; 3.0.2: 2.4.8")
        "Initial unknowns are `calculated` or `approx` outputs, states and derivatives, and calculated parameters; in FMI 3 optionally clocked variables." => "Add the missing entry, or remove the other one.";
    CLOCKED_STATES: Error "clocked-states" ("3.0.2: 2.4.8")
        "The clocked state list holds exactly the variables with `previous`." => "Add the missing entry, or remove the other one.";
    EVENT_INDICATORS: Error "event-indicators" ("3.0.2: 2.4.8")
        "Event indicators are continuous floating-point locals or outputs." => "Refer to such a variable.";

    // Other files.
    LIBRARY_MISSING: Error "library-missing" ("2.0.5: 2.3; 3.0.2: 2.5.1")
        "`binaries` has a library for at least one platform, or the sources are included." => "Add the library, or the sources.";
    LIBRARY_NAME: Error "library-name" ("2.0.5: 2.3; 3.0.2: 2.5.1")
        "Each platform folder has a library named after each model identifier." => "Rename the library to the model identifier.";
    LIBRARY_PLATFORM: Warning "library-platform" ("2.0.5: 2.3; 3.0.2: 2.5.1.4.1")
        "Folders in `binaries` are platform names: FMI 2 `linux64`, `win64`, `darwin64` …, both `x86_64-linux` …" => "Name the folder as the standard does.";
    LIBRARY_FORMAT: Error "library-format" ("2.0.5: 2.3; 3.0.2: 2.5.1.4.1")
        "A library is complete, in its folder's format and for its processor." => "Build the library for this platform, or move it to its platform's folder.";
    LIBRARY_FUNCTION: Error "library-function" ("2.0.5: 2.3; 3.0.2: 2.5")
        "A library exports all functions of the declared interfaces (FMI 3: of all), even for missing capabilities." => "Export the function; where it is not supported, it returns an error.";
    LIBRARY_GUID: Error "library-guid" ("2.0.5: 2.1.5")
        "A library made by fmu-export contains the description's GUID." => "Export the FMU again: description and library come from different builds.";
    LIBRARY_PYTHON: Warning "library-python" ("portability")
        "A library that calls Python links libpython." => "Start the importer with `LD_PRELOAD` set to libpython, or link the library to it.";
    LIBRARY_DEPENDENCY: Warning "library-dependency" ("3.0.2: 2.5.1.4")
        "A Linux library depends only on system libraries and those in its folder." => "Link the library statically, put it beside the FMU's, or document it in `documentation/externalDependencies`.";
    LIBRARY_LOADING: Warning "library-loading" ("portability")
        "A Linux library has no text relocations or executable stack, which hardened systems and newer glibc reject." => "Compile with `-fPIC`, and link with `-z text -z noexecstack`.";
    SOURCES: Error "sources" ("2.0.5: 3.3.1; 3.0.2: 2.4.10")
        "Listed source files exist in `sources`; a build description matches the model identifiers and FMI version." => "Add the file, or correct its name.";
    TERMINALS: Error "terminals" ("3.0.2: 2.4.9")
        "Terminal names are unique, members refer to variables, and named icons exist." => "Correct the name, or add the file.";

    // What importers reject.
    TYPE_DESCRIPTION: Note "type-description" ("importers")
        "Types have no `description` in FMI 3." => "Use a newer version of the importer, or remove the description.";
    ARRAY: Note "array" ("importers")
        "No arrays." => "Export the FMU for FMI 2.0, where each element is a variable.";
    STRUCTURAL_PARAMETER: Note "structural-parameter" ("importers")
        "No structural parameters." => "Give the dimensions as numbers.";
    ENUMERATION_VARIABLE: Note "enumeration-variable" ("importers")
        "No enumerations." => "Export the FMU for FMI 2.0, or declare an integer.";
    CLOCK_VARIABLE: Note "clock-variable" ("importers")
        "No clocks." => "Export the FMU for FMI 2.0, which has none.";
    AMPERE_OR_KELVIN: Note "ampere-or-kelvin" ("importers")
        "No units of the base units `A` and `K`." => "Export the FMU for FMI 2.0, or omit the unit's definition.";
    UNIT_OF_VARIABLE: Note "unit-of-variable" ("importers")
        "No `unit`, `displayUnit`, `nominal`, `quantity`, `relativeQuantity` and `unbounded` of variables." => "Export the FMU for FMI 2.0, or give them by a declared type.";
}
