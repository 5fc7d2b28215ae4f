"""The table of families: where every question comes from."""

from conformance.cases import delicate_families, run_families
from conformance.cases.draw import Family

FAMILIES: dict[str, Family] = {
    family.name: family
    for module in (run_families, delicate_families)
    for family in module.FAMILIES
}
