"""What a service plans before the first question can also be sent."""

from __future__ import annotations

from slopewise.services.daemon import warm_up_requests
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.parameters.active_parameters import ActiveParameters
from slopewise.services.planning.plan_service import PlanService
from slopewise.services.settings.service_settings import ServiceConfig
from slopewise.services.wire import codec


def test_answers_on_all_kinds_of_ground_have_a_wire_form() -> None:
    plans = PlanService(ServiceConfig(model="atv"), ActiveParameters(read_model(find_model("atv"))))
    grounds = {}
    for ground, request in warm_up_requests.requests():
        reply = plans.answer(request, ground, "warm-up")
        # Held, so that no other one gets its id.
        grounds[id(ground)] = ground
        for written in codec.Format:
            assert codec.encode(reply, written)
    assert len(grounds) == 6
