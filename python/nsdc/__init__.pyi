from ._commands import CommandError as CommandError, modes as modes, order as order, verify as verify
from ._controller import Controller as Controller
from ._core import __version__ as __version__
from ._errors import DerivativeError as DerivativeError, Diagnostic as Diagnostic, Edit as Edit, Fix as Fix, InternalError as InternalError, ModelError as ModelError, RunError as RunError, Span as Span
from ._experiment import Experiment as Experiment
from ._figure import Figure as Figure
from ._file import File as File, check as check, explain as explain, load as load, loads as loads
from ._function import Function as Function
from ._gradient import Gradient as Gradient, Moves as Moves
from ._magic import load_ipython_extension as load_ipython_extension
from ._programs import Solution as Solution, solve_nl as solve_nl
from ._quantities import Quantities as Quantities, Quantity as Quantity
from ._result import Event as Event, Mode as Mode, Result as Result
from ._sweep import Sweep as Sweep
