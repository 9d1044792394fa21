"""One physical flow in every form that granpinn reads."""

from tests.importers.forms import beside, containers, files, memory, tables, texts

FAMILIES = {
    **texts.FAMILIES,
    **memory.FAMILIES,
    **containers.FAMILIES,
    **tables.FAMILIES,
    **beside.FAMILIES,
    **files.FAMILIES,
}
