"""A bench: its file, its devices opened behind the guard, and the rig that procedures drive."""
