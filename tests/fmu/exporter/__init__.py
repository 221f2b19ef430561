"""The exporter on models that have one of everything, with an importer that calls its C functions.

Only here is it tested what a call does that is right: the values, events and messages that follow from the
models, where they are known beforehand. So is what needs more than the functions of an instance: FMPy's own
reading, what fmi2Instantiate takes, callbacks, threads, other processes and a limit of memory. That each
function is refused in other states and with other arguments, that errors change nothing, and that saved
states go on identically, is tested in Rust for all functions or at random (crates/fmu-export/tests/importer).
"""
