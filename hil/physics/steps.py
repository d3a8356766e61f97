"""Exact steps of linear stages as the coefficients that pages of equations name."""

from __future__ import annotations

from hil.physics.linear import first_order, second_order


def lag_step(name: str, time_constant_s: float, step_s: float) -> dict[str, float]:
    """`first_order` as coefficients of a page: `NAME_keep` of what it was, `NAME_old` and `NAME_new` of its input."""
    keep, old, new = first_order(time_constant_s, step_s)
    return {f"{name}_keep": keep, f"{name}_old": old, f"{name}_new": new}


def spring_step(frequency_rad_s: float, damping: float, step_s: float, suffix: str = "") -> dict[str, float]:
    """`second_order` as coefficients of a page; a held input moves place by `compliance` and speed by `mobility`."""
    xx, xv, x0, x1, vx, vv, v0, v1 = second_order(frequency_rad_s, damping, step_s)
    return {
        f"xx{suffix}": xx, f"xv{suffix}": xv, f"x0{suffix}": x0, f"x1{suffix}": x1, f"compliance{suffix}": x0 + x1,
        f"vx{suffix}": vx, f"vv{suffix}": vv, f"v0{suffix}": v0, f"v1{suffix}": v1, f"mobility{suffix}": v0 + v1,
    }  # fmt: skip
