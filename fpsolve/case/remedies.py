"""The remedies of messages in the words of those who work with case files and the command line."""

from __future__ import annotations

from collections.abc import Mapping

from fpsolve.errors import Remedy

CASE_WORDS: Mapping[Remedy, str] = {
    Remedy.MESH: "use more cells ([mesh] phi_cells, xi_cells), a wider noise interval (xi_min, xi_max) or no [mesh]",
    Remedy.CELLS: "use more cells in [mesh], or a smaller rtol where there is none",
    Remedy.REACH: "use a [mesh] that reaches there, or no [mesh]",
    Remedy.BUDGET: "use a larger rtol or a larger [budget]",
    Remedy.MESH_FILE: "make one with `fpsolve mesh`",
    Remedy.REDUCTION: 'or treatment = "ou-reduction"',
    Remedy.NO_REDUCTION: 'treatment = "exact" keeps Eq. (7)',
    Remedy.FOLDER: "choose another --out",
}


def in_words_of_a_case(text: str) -> str:
    """A message with the keys and options that its remedy means; without a remedy the message itself."""
    for remedy, words in CASE_WORDS.items():
        text = text.replace(remedy, words)
    return text
