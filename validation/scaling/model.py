"""What a step costs on so many ranks: a sum of what was measured, with latency and bandwidth of a network that are assumed."""
import math
from dataclasses import dataclass

LATENCY = 2e-6        # s: of one message, and of each of the log2(ranks) stages of a collective
BANDWIDTH = 10e9      # bytes/s, of one rank
MOST_RANKS = 4096


@dataclass
class Constants:
    """Measured. Of one rank, and of a step."""
    exterior: float      # s: an exterior granule
    interface: float     # s: an interface granule
    stored: float        # s: a stored granule
    collectives: tuple   # of the fix and of LIGGGHTS
    gathered: tuple      # bytes that collectives give to each rank: (fixed, for each rank more), of the fix
    messages: tuple      # to single ranks, of the fix and of LIGGGHTS
    sent: tuple          # bytes of these, of the fix and of LIGGGHTS,
    sent_by: float       # where a rank has so many atoms


@dataclass
class Scene:
    name: str
    granules: float
    exterior: float
    interface: float
    culled: bool = True
    uneven: float = 1.0  # atoms of the rank with most, over the mean of those that have some
    places: float = math.inf  # ranks that have some, at most: what moves lies in one place


def parts(scene, ranks, of):
    """Seconds of a step, by what takes them: work, which ranks share; messages, which they share in part; collectives, which grow."""
    share = scene.uneven / min(ranks, scene.places)
    atoms = share * (scene.exterior + scene.interface)
    stored = max(0.0, scene.granules - scene.exterior - scene.interface) / ranks
    work = share * (scene.exterior * of.exterior + scene.interface * of.interface) + stored * of.stored * scene.culled
    if ranks == 1:
        return {"work": work, "messages": 0.0, "collectives": 0.0}
    who = (0, 1) if scene.culled else (1,)
    edge = math.sqrt(atoms / of.sent_by)  # cuts in x and y: what is at them grows as the edge of a rank's part
    messages = sum(of.messages[w] * LATENCY + of.sent[w] * edge / BANDWIDTH for w in who)
    collectives = sum(of.collectives[w] for w in who) * LATENCY * math.log2(ranks)
    collectives += scene.culled * max(0.0, of.gathered[0] + of.gathered[1] * ranks) / BANDWIDTH
    return {"work": work, "messages": messages, "collectives": collectives}


def seconds(scene, ranks, of):
    return sum(parts(scene, ranks, of).values())


def bend(scene, of):
    """The smallest number of ranks, a power of two, on which messages and collectives take more than the work; None up to MOST_RANKS."""
    ranks = 2
    while ranks <= MOST_RANKS:
        each = parts(scene, ranks, of)
        if each["messages"] + each["collectives"] > each["work"]:
            return ranks
        ranks *= 2
    return None


def line_through(points):
    """a and b of a + b x, by least squares, b not below 0."""
    n = len(points)
    mx, my = sum(x for x, _ in points) / n, sum(y for _, y in points) / n
    spread = sum((x - mx)**2 for x, _ in points)
    b = max(0.0, sum((x - mx) * (y - my) for x, y in points) / spread) if spread else 0.0
    return my - b * mx, b
