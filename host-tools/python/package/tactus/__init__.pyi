from os import PathLike
from typing import Any, Dict, Iterable, List, Mapping, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

__version__: str
TEXTURES: List[str]

class TactusError(Exception):
    """Whatever goes wrong in this package: the sentence of the command line, which says what to do."""

class RecordingError(TactusError):
    """Recordings cannot be read or written."""

class SlideError(TactusError):
    """A slide has no features: it is too short, silent, or not whole."""

class SimulationError(TactusError):
    """The simulated rig has a fault, or gives no slide."""

class TableError(TactusError):
    """A table cannot be learned, read, explored or written."""

class Features:
    """What one slide measures. `None` where the rig could not measure it."""

    @property
    def force_n(self) -> float: ...
    @property
    def speed_mm_s(self) -> float: ...
    @property
    def traction_n(self) -> Optional[float]: ...
    @property
    def roughness_ln(self) -> Optional[float]: ...
    @property
    def roughness_is_bound(self) -> bool: ...
    @property
    def fineness_unfiltered_ln(self) -> Optional[float]: ...
    @property
    def ln_psd_bands(self) -> NDArray[np.float32]: ...
    @property
    def ln_fused_bands(self) -> NDArray[np.float32]: ...
    @property
    def spectrum(self) -> NDArray[np.float32]: ...
    @property
    def frequencies_hz(self) -> NDArray[np.float32]: ...
    @property
    def background(self) -> float: ...
    @property
    def pdc(self) -> Optional[Tuple[float, float]]: ...

def features(
    pac: NDArray[np.int16],
    *,
    window_s: Tuple[float, float],
    force_n: float,
    speed_mm_s: float,
    still: Optional[NDArray[np.int16]] = None,
    background: Optional[float] = None,
    shear_mn: Optional[NDArray[np.int16]] = None,
    shear_rate_hz: int = 100,
    pdc: Optional[NDArray[np.int16]] = None,
    pdc_rate_hz: int = 100,
) -> Features: ...

class Slide:
    """One recorded slide with its samples."""

    @property
    def texture(self) -> str: ...
    @property
    def number(self) -> int: ...
    @property
    def force_n(self) -> float: ...
    @property
    def speed_mm_s(self) -> float: ...
    @property
    def window_s(self) -> Tuple[float, float]: ...
    @property
    def pac(self) -> NDArray[np.int16]: ...
    @property
    def pac_rate_hz(self) -> int: ...
    @property
    def still(self) -> NDArray[np.int16]: ...
    @property
    def background(self) -> Optional[float]: ...
    @property
    def pdc(self) -> NDArray[np.int16]: ...
    @property
    def pdc_rate_hz(self) -> int: ...
    @property
    def shear_mn(self) -> Optional[NDArray[np.int16]]: ...
    @property
    def shear_rate_hz(self) -> int: ...
    def features(self) -> Features: ...

def features_of(slides: Sequence[Slide]) -> List[Features]: ...

class Recordings:
    """A folder of recorded slides."""

    def __init__(self, folder: Union[str, PathLike[str]]) -> None: ...
    @property
    def folder(self) -> PathLike[str]: ...
    @property
    def textures(self) -> List[str]: ...
    @property
    def numbers(self) -> List[int]: ...
    @property
    def settings(self) -> List[Tuple[float, float]]: ...
    @property
    def finger(self) -> Tuple[str, int]: ...
    def manifest(self) -> List[Dict[str, Any]]: ...
    def slides(self, texture: Union[int, str]) -> List[Slide]: ...
    def measured_slides(self, texture: Union[int, str]) -> List[Features]: ...
    def features(self) -> Dict[str, NDArray[Any]]: ...
    def __len__(self) -> int: ...

class Properties:
    """A table of measured properties (columns texture, movement, trial, set, traction, roughness, fineness), as for
    `tactus evaluate --properties`. Raises RecordingError where it makes no sense."""

    def __init__(self, file: Union[str, PathLike[str]]) -> None: ...
    @property
    def textures(self) -> List[str]: ...

class Table:
    """A texture table."""

    @staticmethod
    def learn(
        recordings: Recordings,
        *,
        train_slides: int = 5,
        method: str = "fused",
        features: Optional[str] = None,
        drift: Tuple[float, float] = (0.1, 0.04),
        false_alarm: Optional[float] = None,
    ) -> Table: ...
    @staticmethod
    def learn_slides(
        slides: Mapping[str, Sequence[Features]],
        *,
        method: str = "fused",
        features: Optional[str] = None,
        drift: Tuple[float, float] = (0.1, 0.04),
        false_alarm: Optional[float] = None,
    ) -> Table: ...
    @staticmethod
    def load(path: Union[str, PathLike[str]]) -> Table: ...
    @staticmethod
    def from_bytes(bytes: bytes) -> Table: ...
    def save(self, path: Union[str, PathLike[str]]) -> None: ...
    def summary(self) -> Dict[str, Any]: ...
    @property
    def textures(self) -> List[str]: ...
    @property
    def settings(self) -> List[Tuple[float, float]]: ...
    @property
    def method(self) -> str: ...
    @property
    def finger(self) -> str: ...
    @property
    def checksum(self) -> str: ...
    def __bytes__(self) -> bytes: ...
    def __len__(self) -> int: ...

def evaluate(
    recordings: Union[Recordings, Properties],
    *,
    method: str = "fused",
    protocol: str = "interleaved",
    train_slides: Optional[int] = None,
    runs: int = 8000,
    seed: int = 1,
    threshold: float = 0.99,
    max_slides: int = 10,
    features: Optional[str] = None,
    drift: Tuple[float, float] = (0.1, 0.04),
    false_alarm: Optional[float] = None,
    test: Optional[Recordings] = None,
    reliability: bool = True,
) -> Dict[str, Any]: ...
def novelty(
    recordings: Union[Recordings, Properties],
    left_out: int = 1,
    *,
    protocol: str = "interleaved",
    train_slides: Optional[int] = None,
    runs: int = 8000,
    seed: int = 1,
    max_slides: int = 10,
    features: Optional[str] = None,
    drift: Tuple[float, float] = (0.1, 0.04),
    false_alarm: Optional[float] = None,
) -> Dict[str, Any]: ...
def evaluate_verify(
    recordings: Union[Recordings, Properties],
    *,
    protocol: str = "interleaved",
    train_slides: Optional[int] = None,
    runs: int = 8000,
    seed: int = 1,
    max_slides: int = 10,
    features: Optional[str] = None,
    drift: Tuple[float, float] = (0.1, 0.04),
    false_alarm: Optional[float] = None,
) -> Dict[str, Any]: ...

class Explorer:
    """An exploration of one unknown texture with a table, as the probe makes it."""

    def __init__(
        self,
        table: Table,
        *,
        among: Optional[Sequence[str]] = None,
        method: Optional[str] = None,
        threshold: float = 0.99,
        max_slides: int = 10,
        open: bool = True,
        false_alarm: Optional[float] = None,
        measures: Optional[Sequence[str]] = None,
        seed: int = 1,
    ) -> None: ...
    def restart(self) -> None: ...
    def next_movement(self) -> Dict[str, Any]: ...
    def expected(self) -> List[Dict[str, Any]]: ...
    def update(self, slide: Features, property: Optional[str] = None) -> None: ...
    def reject(self, force_n: float, speed_mm_s: float) -> bool: ...
    @property
    def posterior(self) -> NDArray[np.float32]: ...
    @property
    def textures(self) -> List[str]: ...
    @property
    def slides(self) -> int: ...
    def verdict(self) -> Optional[Dict[str, Any]]: ...
    def best(self) -> Dict[str, Any]: ...
    def verification(self) -> Optional[Dict[str, Any]]: ...

def verify(
    table: Table,
    texture: str,
    slides: Iterable[Features],
    *,
    threshold: float = 0.99,
    max_slides: int = 10,
    false_alarm: Optional[float] = None,
) -> List[Dict[str, Any]]: ...

class SimulatedRig:
    """A simulated rig with a texture under its finger."""

    def __init__(self, texture: str, *, seed: int = 1, trial: int = 1, finger: str = "biotac") -> None: ...
    @property
    def texture(self) -> str: ...
    @property
    def time_s(self) -> float: ...
    def slide(self, force_n: float, speed_mm_s: float) -> Slide: ...

def simulate(
    textures: Optional[Sequence[str]] = None, *, trials: int = 5, seed: int = 1, finger: str = "biotac"
) -> Dict[str, List[Slide]]: ...
def learn_by_hand(
    textures: Optional[Sequence[str]] = None, *, trials: int = 5, seed: int = 1, finger: str = "biotac"
) -> Tuple[Table, List[str]]: ...
