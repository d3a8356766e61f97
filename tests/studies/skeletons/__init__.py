"""Units of another structure than the library's: each file was written from its brief, without a look at `hil`.

A skeleton has `PLANT` (the model that is asked for), `CHANNELS` (its command first), `STEP_S`, `NOISE` (standard
deviation by channel), `draw(rng)` (a unit), `respond(unit, command)` (noise-free channels) and `CHANGES` (by neutral
name: the unit with an amount of it, 0 to 1).
"""
