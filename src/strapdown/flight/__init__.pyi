"""The public names of this room, each with the module that it comes from."""

from .aircraft_model.modes import linearise as linearise
from .aircraft_model.parameters import Aircraft as Aircraft, aircraft as aircraft
from .aircraft_model.trim import trim as trim
from .asked import Loop as Loop, Sensors as Sensors, World as World
from .plan import FlightPlan as FlightPlan
from .run_flight import Flight as Flight, fly as fly
