"""The status of a service as Prometheus reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from prometheus_client import CollectorRegistry, ProcessCollector
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily, Metric
from prometheus_client.registry import Collector

from slopewise.services.wire.plan_messages import ServiceStatus

_MAX_FLAGS = 32
"""Warnings with a time series each [1]; their number is a series as well."""

_QUANTILES = {"median": "0.5", "p99": "0.99"}


class StatusCollector(Collector):
    """Metrics from the status, made on request."""

    def __init__(self, status: Callable[[], ServiceStatus]) -> None:
        self._status = status

    def describe(self) -> Iterable[Metric]:
        """Nothing in advance: the names are fixed."""
        return []

    def collect(self) -> Iterable[Metric]:
        status = self._status()
        parameters = status.parameters
        events = CounterMetricFamily("slopewise_events", "Events since the start.", labels=["kind"])
        for kind, count in sorted(status.counters.items()):
            events.add_metric([kind], count)
        seconds = GaugeMetricFamily(
            "slopewise_answer_seconds",
            "From arrival to reply, of recent replies.",
            labels=["quantile"],
        )
        for quantile, value in status.seconds.items():
            seconds.add_metric([_QUANTILES.get(quantile, quantile)], value)
        flags = GaugeMetricFamily("slopewise_flag", "1 for each warning.", labels=["reason"])
        for reason in status.flags[:_MAX_FLAGS]:
            flags.add_metric([reason], 1.0)
        yield from (events, seconds, flags)
        gauges: tuple[tuple[str, str, float | None], ...] = (
            ("slopewise_flags", "Number of warnings.", len(status.flags)),
            ("slopewise_uptime_seconds", "Since the start.", status.uptime),
            ("slopewise_parameters_version", "Grows with every change.", parameters.version),
            ("slopewise_parameters_age_seconds", "Since the last update.", parameters.age),
            ("slopewise_map_version", "Grows with every update; 0 without.", status.map_version),
            ("slopewise_map_age_seconds", "Since the last update.", status.map_age),
        )
        for name, meaning, number in gauges:
            if number is not None:
                yield GaugeMetricFamily(name, meaning, value=number)
        identity = {
            "service": status.service,
            "model": parameters.name,
            "vehicle": parameters.fingerprint,
        }
        yield InfoMetricFamily("slopewise_service", "Identity of the service.", value=identity)


def registry(status: Callable[[], ServiceStatus]) -> CollectorRegistry:
    """Metrics of the service and of its process: processor time, memory, open files."""
    metrics = CollectorRegistry()
    metrics.register(StatusCollector(status))
    ProcessCollector(registry=metrics)
    return metrics
