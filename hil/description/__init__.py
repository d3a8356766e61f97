"""Devices by description: what a TOML file says of a device, from which its driver, twin, page and checks are made."""
