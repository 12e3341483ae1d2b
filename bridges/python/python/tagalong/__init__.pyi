from collections.abc import Sequence
from os import PathLike
from typing import Any, Optional, Union

from numpy.typing import NDArray

from ._tagalong import (
    Camera as Camera,
    Command as Command,
    ConfigError as ConfigError,
    Frame as Frame,
    Frames as Frames,
    Pipeline as Pipeline,
    Report as Report,
    TagalongError as TagalongError,
    Track as Track,
    __version__ as __version__,
)

_Path = Union[str, PathLike[str]]

def main(arguments: Optional[Sequence[str]] = None) -> int: ...
def run(
    config: Optional[_Path],
    log: _Path,
    out: _Path,
    *,
    overlay: bool = False,
    with_images: bool = False,
    smoothed: bool = False,
    overwrite: bool = False,
    strict: bool = False,
    seed: Optional[int] = None,
    camera: Optional[str] = None,
) -> dict[str, Any]: ...
def eval(
    truth: _Path,
    tracks: _Path,
    *,
    similarity: str = "iou",
    log: Optional[_Path] = None,
    rate: Optional[float] = None,
    upper_body: bool = False,
    repairs: bool = False,
    drop_doubled_ids: bool = False,
) -> dict[str, Any]: ...
def read_tracks(path: _Path, *, smoothed: bool = False) -> dict[str, NDArray[Any]]: ...
