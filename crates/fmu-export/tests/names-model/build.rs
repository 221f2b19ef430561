//! Generates the typed interface and the modelDescription.xml of the model.

fn main() {
    fmu_export_build::generate("model.json");
}
