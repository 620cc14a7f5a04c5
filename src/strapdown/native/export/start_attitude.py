"""The only computation in the start of an exported filter: the attitude from its angles."""

from ...core.compile.jit import Kernel
from ...core.compile.signatures import reals, signature
from ...core.loop.contract import kernel
from ...core.mathematics.rotation import euler_to_matrix
from ...typing import Array

ATTITUDE = signature("attitude", rph=reals(3), C=reals(3, 3))


def _attitude(rph: Array, C: Array) -> None:
    """C_nb of roll, pitch and heading, rad."""
    euler_to_matrix(rph[0], rph[1], rph[2], C)


# not above the function: the library of kernels takes what is declared there, and has no use for it
attitude: Kernel = kernel(ATTITUDE, "attitude")(_attitude)  # type: ignore[assignment]
