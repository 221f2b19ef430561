//! Generates the typed interface and the modelDescription.xml from the declaration.

fn main() {
    fmu_export_build::generate("controller.json");
}
