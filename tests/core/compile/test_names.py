"""Names of compiled functions: the linker takes two helpers of one name, cached by different
processes, for one function."""

import importlib
import pkgutil

import pytest

from strapdown.core.loop.contract import COMPILED

pytestmark = pytest.mark.short


def compiled_functions():
    for package in ("core", "aiding", "filters"):
        for module in pkgutil.walk_packages(
            importlib.import_module(f"strapdown.{package}").__path__, f"strapdown.{package}."
        ):
            for value in vars(importlib.import_module(module.name)).values():
                if hasattr(value, "py_func"):
                    yield value.py_func


@pytest.mark.skipif(not COMPILED, reason="the compiler is off")
def test_every_compiled_function_has_a_name_of_its_own():
    found = {id(function): function for function in compiled_functions()}.values()
    names = [(function.__module__, function.__qualname__) for function in found]
    assert len(names) > 200 and len(set(names)) == len(names)
    # a closure or lambda shares its name with others made in the same place
    assert not [name for name in names if "<" in name[1]]
