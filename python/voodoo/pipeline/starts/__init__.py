"""Sources of first poses: one module for each kind of input."""

from voodoo.pipeline.starts.base import FoundStart as FoundStart
from voodoo.pipeline.starts.base import StartFinder as StartFinder
from voodoo.pipeline.starts.base import StartFrame as StartFrame
from voodoo.pipeline.starts.chosen import Starts as Starts
