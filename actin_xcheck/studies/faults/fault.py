"""A deliberate fault and how it gets into the code: one function is replaced, and put back.

Targets are named, "package.module:Class.function": what is made wrong is loaded by its name, as methods are.
A control that never ran proves nothing, so that a name that no longer exists and a function that was never
called are errors, not faults that were missed.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property, reduce, wraps
from importlib import import_module
from inspect import getattr_static
from typing import Any

from actin_xcheck.runs.executor import in_turn

Function = Callable[..., Any]


class ControlError(Exception):
    """A control that proves nothing: its target is gone, or was never called."""


@dataclass(frozen=True)
class Fault:
    """Something a moving-cell code must get right, got wrong on purpose.

    Attributes
    ----------
    name : what the user types.
    sentence : what is wrong.
    code : whose fault it is: "fem", "fv", "both" or "harness".
    target : "package.module:function" or "package.module:Class.function"; properties count as functions.
    wrong : stands in for the target; given the right function, then what that would be given.  A function of
        some module, so that another process finds it.
    """

    name: str
    sentence: str
    code: str
    target: str
    wrong: Function


class Catalogue(list[Fault]):
    """Faults, each stated where the function is that does it."""

    def __call__(
        self, name: str, code: str, target: str, sentence: str = ""
    ) -> Callable[[Function], Function]:
        """State a fault, see `Fault`, of the function that is decorated; its docstring is the sentence."""

        def stated(wrong: Function) -> Function:
            self.append(Fault(name, sentence or wrong.__doc__ or "", code, target, wrong))
            return wrong

        return stated


@dataclass
class Calls:
    """How often a replaced function was called."""

    count: int = 0


def unchanged(right: Function, *arguments: Any, **named: Any) -> Any:
    """No fault at all."""
    return right(*arguments, **named)


@contextmanager
def replaced(target: str, wrong: Function = unchanged) -> Iterator[Calls]:
    """Replace a function within a `with` block, and count how often it is called there.

    Raises ControlError where there is no such function.
    """
    owner, name = _found(target)
    stored, calls = getattr_static(owner, name), Calls()
    right = _function(stored)

    @wraps(right)
    def counted(*arguments: Any, **named: Any) -> Any:
        calls.count += 1
        return wrong(right, *arguments, **named)

    own = name in vars(owner)
    setattr(owner, name, _as_before(stored, counted, owner, name))
    try:
        yield calls
    finally:
        if own:
            setattr(owner, name, stored)
        else:  # it was inherited
            delattr(owner, name)


@contextmanager
def injected(fault: Fault) -> Iterator[None]:
    """Switch a fault on within a `with` block; work asked for there is done in this process.

    Raises ControlError where its target is gone, and at the end of the block where it was never called.
    """
    with in_turn(), replaced(fault.target, fault.wrong) as calls:
        yield
    if not calls.count:
        raise ControlError(f"{fault.name}: {fault.target} was never called")


@contextmanager
def watched(targets: tuple[str, ...]) -> Iterator[dict[str, Calls]]:
    """Count the calls of several functions within a `with` block; nothing is changed."""
    with in_turn(), ExitStack() as stack:
        yield {target: stack.enter_context(replaced(target)) for target in dict.fromkeys(targets)}


def there(targets: Iterable[str]) -> tuple[str, ...]:
    """Those targets that exist: a control whose target is gone says so itself."""
    found = []
    for target in targets:
        try:
            _found(target)
        except ControlError:
            continue
        found.append(target)
    return tuple(found)


def _found(target: str) -> tuple[Any, str]:
    """The module or class that holds a target, and the target's name in it."""
    module, _, path = target.partition(":")
    *classes, name = path.split(".")
    try:
        owner = reduce(getattr, classes, import_module(module))
        getattr_static(owner, name)
    except (ImportError, AttributeError) as error:
        raise ControlError(f"{target} is gone: {error}") from error
    return owner, name


def _function(stored: Any) -> Function:
    """The function behind what a class or module holds."""
    if isinstance(stored, property):
        assert stored.fget is not None
        return stored.fget
    found: Function = getattr(stored, "func" if isinstance(stored, cached_property) else "__func__", stored)
    return found


def _as_before(stored: Any, function: Function, owner: Any, name: str) -> Any:
    """A function as the property, class method or plain function that it replaces."""
    if isinstance(stored, cached_property):
        made = cached_property(function)
        made.__set_name__(owner, name)
        return made
    if isinstance(stored, property | classmethod | staticmethod):
        return type(stored)(function)
    return function
