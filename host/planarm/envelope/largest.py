"""The largest payload and feed with which a scene's certificate has no red check, by bisection."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from planarm.errors import CertificateError, TimingError
from planarm.scene import Scene
from planarm.stepping.certificate import Certificate

Certify = Callable[[Scene], Certificate]
"""Plans a scene and returns the certificate."""

MOST_DOUBLINGS = 6
HALVINGS = 6
MOST_TRIALS = MOST_DOUBLINGS + HALVINGS


@dataclass(frozen=True, slots=True)
class Largest:
    """A value that holds and one that does not.

    Attributes:
        value: the largest that was found to hold.
        fails_at: the least that was found not to hold; infinite when all that were tried hold.
        because: what fails there, in words.
    """

    value: float
    fails_at: float
    because: str


def largest_payload_kg(scene: Scene, certify: Certify, first_kg: float = 0.1, steps: int = HALVINGS) -> Largest:
    """Return the largest mass at the end of the arm, beside what the scene's links and motors weigh."""

    def loaded(kg: float) -> Scene:
        *inner, _ = scene.mechanics.end_masses_kg
        return replace(scene, mechanics=replace(scene.mechanics, end_masses_kg=(*inner, kg)))

    return bisect(loaded, certify, first_kg, steps)


def largest_feed(scene: Scene, certify: Certify, steps: int = HALVINGS) -> Largest:
    """Return by how much all joints' speed limits can be raised, 1 being the scene's own."""

    def faster(factor: float) -> Scene:
        joints = tuple(replace(one, max_speed_rad_s=factor * one.max_speed_rad_s) for one in scene.joints)
        return replace(scene, joints=joints)

    return bisect(faster, certify, 1.0, steps)


def bisect(scene_at: Callable[[float], Scene], certify: Certify, first: float, steps: int) -> Largest:
    """Double the value while it holds, then halve between what holds and what fails; 0 where `first` fails, too."""
    holds, fails, because = 0.0, float("inf"), ""
    value = first
    for _ in range(MOST_DOUBLINGS):
        because = why_not(scene_at(value), certify)
        if because:
            fails = value
            break
        holds, value = value, 2.0 * value
    for _ in range(steps if fails < float("inf") else 0):
        middle = 0.5 * (holds + fails)
        problem = why_not(scene_at(middle), certify)
        if problem:
            fails, because = middle, problem
        else:
            holds = middle
    return Largest(holds, fails, because)


def why_not(scene: Scene, certify: Certify) -> str:
    """Return what forbids the scene, empty when nothing does."""
    try:
        certificate = certify(scene)
    except (TimingError, CertificateError) as problem:
        return str(problem)
    return "" if certificate.ok else certificate.explain()
