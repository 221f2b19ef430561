"""The exporter on models that have one of everything, with an importer that calls its C functions."""
