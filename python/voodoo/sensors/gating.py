"""Gates around predicted sites, which reject measurements too far from the prediction."""

from voodoo._core import SiteGate as SiteGate
