"""Limits and objectives of a design; `tpd.design.criteria` defines them."""

from tpd.design.criteria import *  # noqa: F403
