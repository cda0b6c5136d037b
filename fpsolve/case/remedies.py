"""The words of remedies for those who work with case files and the command line."""

from __future__ import annotations

from fpsolve.messages import Audience, Remedy

CASE_WORDS: Audience = {
    Remedy.MESH: "use more cells ([mesh] phi_cells, xi_cells), a wider noise interval (xi_min, xi_max) or no [mesh]",
    Remedy.CELLS: "use more cells in [mesh], or a smaller rtol where there is none",
    Remedy.REACH: "use a [mesh] that reaches there, or no [mesh]",
    Remedy.BUDGET: "use a larger rtol or a larger [budget]",
    Remedy.MANY: "use a larger rtol or a larger [budget]; p = 2 takes little and bounds it, as Λ(p) <= p Λ(2)/2 for "
    "0 < p < 2 and λ <= Λ(2)/2, and `fpsolve simulate` gives it with a standard error",
    Remedy.MESH_FILE: "make one with `fpsolve mesh`",
    Remedy.REDUCTION: 'or treatment = "ou-reduction"',
    Remedy.NO_REDUCTION: 'treatment = "exact" keeps Eq. (7)',
    Remedy.SIMULATION: "or simulate it, see [monte_carlo] and `fpsolve simulate`",
    Remedy.FOLDER: "choose another --out",
    Remedy.MEMORY: "use a smaller [budget], or fewer --jobs",
}
