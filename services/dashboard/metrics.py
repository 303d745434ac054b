"""The status of a service as Prometheus reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    InfoMetricFamily,
    Metric,
)
from prometheus_client.registry import Collector

from slopewise.services.wire.plan_messages import ServiceStatus


class StatusCollector(Collector):
    """Metrics out of the status, made when somebody asks."""

    def __init__(self, status: Callable[[], ServiceStatus]) -> None:
        """Ask for the status there."""
        self._status = status

    def describe(self) -> Iterable[Metric]:
        """Nothing ahead: names do not depend on what is asked."""
        return []

    def collect(self) -> Iterable[Metric]:
        """All metrics of now."""
        status = self._status()
        events = CounterMetricFamily(
            "slopewise_events", "What happened since the start, by kind.", labels=["kind"]
        )
        for kind, count in sorted(status.counters.items()):
            events.add_metric([kind], count)
        yield events
        seconds = GaugeMetricFamily(
            "slopewise_answer_seconds",
            "From arrival to answer, of late answers.",
            labels=["quantile"],
        )
        for quantile, value in status.seconds.items():
            seconds.add_metric([_QUANTILES.get(quantile, quantile)], value)
        yield seconds
        flags = GaugeMetricFamily(
            "slopewise_flag", "1 for each thing that is not as it should be.", labels=["reason"]
        )
        for reason in status.flags[:_MOST_FLAGS]:
            flags.add_metric([reason], 1.0)
        yield flags
        parameters = status.parameters
        gauges: tuple[tuple[str, str, float | None], ...] = (
            ("slopewise_flags", "How many things are not as they should be.", len(status.flags)),
            ("slopewise_uptime_seconds", "Since the start.", status.uptime),
            ("slopewise_parameters_version", "Grows with every change.", parameters.version),
            ("slopewise_parameters_age_seconds", "Since they were taken up.", parameters.age),
            ("slopewise_map_version", "Grows with every update; 0 without.", status.map_version),
            ("slopewise_map_age_seconds", "Since the last update.", status.map_age),
        )
        for name, words, number in gauges:
            if number is not None:
                yield GaugeMetricFamily(name, words, value=number)
        told = {
            "service": status.service,
            "model": parameters.name,
            "vehicle": parameters.fingerprint,
        }
        yield InfoMetricFamily("slopewise_service", "Who this is.", value=told)


_MOST_FLAGS = 32
_QUANTILES = {"median": "0.5", "p99": "0.99"}


def registry(status: Callable[[], ServiceStatus]) -> CollectorRegistry:
    """Metrics of the service and of its process: processor time, memory, open files."""
    made = CollectorRegistry()
    made.register(StatusCollector(status))
    ProcessCollector(registry=made)
    return made
