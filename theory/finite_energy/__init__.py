"""Finite energy, beyond the paper: what is left of the limit when particles are not infinitely fast.

`rates` reads what `mushrooms.audit.frozen` has measured on frozen tables and follows it through a cycle,
and `one_cycle` has the distribution of energies that it makes. `upright` is of stems with upright sides,
`fits` of what is measured.
"""
