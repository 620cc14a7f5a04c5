"""The one thing that the start of an exported filter computes: the attitude of its angles."""

from ...core.contract import kernel
from ...core.rotation import euler_to_matrix
from ...core.signatures import reals, signature
from ...typing import Array

ATTITUDE = signature("attitude", rph=reals(3), C=reals(3, 3))


@kernel(ATTITUDE)
def attitude(rph: Array, C: Array) -> None:
    """C_nb of roll, pitch and heading, rad."""
    euler_to_matrix(rph[0], rph[1], rph[2], C)
